//! From joined triangles to one consistent, outward-oriented surface. Only what is broken is
//! touched: a clean mesh passes unchanged, and each repair is counted.

use glam::DVec3;

use super::cracks;
use super::crossing::{Crossing, crossing};
use super::given::Given;
use super::mass::Integrals;
use super::orient::{self, Role, Shell};
use super::topology::{self, Edges, NONE, ends};
use super::weld::Soup;
use super::{Health, MassProperties, Mesh};
use crate::error::{Error, ErrorKind, Result};

/// Distance within which corners at an opening are taken for one, as a share of the bounding box's
/// diagonal: 1 um on 100 mm.
const JOIN: f64 = 1e-5;
/// Width of a needle as a share of that distance.
const NEEDLE: f64 = 0.1;
/// Most rounds of mending: a triangle has one of its edges cut in each.
const ROUNDS: usize = 6;

/// The repaired surface and what is known about it.
pub(super) struct Repaired {
    pub mesh: Mesh,
    pub health: Health,
    /// Neighbours, with windings agreeing.
    pub edges: Edges,
    pub shell_of: Vec<u32>,
    pub shells: Vec<Shell>,
    /// Diagonal of the bounding box \[m\].
    pub diagonal: f64,
    /// Rounding of the coordinates to 32-bit floats \[m\].
    pub noise: f64,
    /// Unit of the file's numbers \[m\].
    pub unit: f64,
    /// The faces that the file states \[m\].
    pub given: Given,
    apex: DVec3,
}

impl Repaired {
    /// Measures the shells again, after vertices have moved.
    pub(super) fn measure_again(&mut self) {
        orient::measure(&self.mesh, &self.shell_of, &mut self.shells, self.apex);
    }

    /// Mass properties at density 1 of all material.
    pub(super) fn mass(&self) -> MassProperties {
        let mut total = Integrals::default();
        for shell in self.shells.iter().filter(|shell| shell.role != Role::Embedded) {
            total.merge(&shell.integrals);
        }
        total.properties(self.apex)
    }
}

/// Repairs `soup`, whose unit is `scale` metres. `place` names it in errors.
///
/// # Errors
/// When no triangle with an area is left.
pub(super) fn repair(soup: Soup, scale: f64, place: &str) -> Result<Repaired> {
    let mut health = Health {
        triangles_read: soup.read,
        degenerate_removed: soup.read - soup.triangles.len(),
        warnings: soup.warnings,
        ..Health::default()
    };
    let mut mesh = Mesh { vertices: soup.vertices, triangles: soup.triangles };
    let mut given = soup.given;
    if scale != 1.0 {
        given.scale(scale);
        for vertex in &mut mesh.vertices {
            *vertex *= scale;
        }
    }
    let (low, high) = mesh.bounding_box();
    let diagonal = (high - low).length();
    if mesh.triangles.is_empty() || diagonal <= 0.0 || !diagonal.is_finite() {
        return Err(Error::new(
            ErrorKind::Geometry,
            place,
            "no triangle has an area",
            "export the part as a surface mesh; check that its coordinates were not all rounded to the same value",
        ));
    }
    // Half a unit in the last place of the largest coordinate (in the file's unit, but the ratio is
    // much the same).
    let noise = low.abs().max(high.abs()).max_element().log2().floor().exp2()
        * f64::from(f32::EPSILON)
        / 2.0;
    if noise > JOIN * diagonal {
        health
            .warnings
            .push(format!("the part lies so far from the origin that its coordinates are exact to {:.3} um only; move it there and export again", noise * 1e6));
    }
    let tolerance = (JOIN * diagonal).max(4.0 * noise);
    let mut edges = topology::edges(&mesh);
    mend(&mut mesh, &mut given, &mut edges, tolerance, &mut health);
    if mesh.triangles.is_empty() {
        return Err(Error::new(
            ErrorKind::Geometry,
            place,
            "no triangle has an area above rounding",
            "export the part as a surface mesh",
        ));
    }
    let apex = (low + high) / 2.0;
    let (shell_of, shells) = orient::orient(&mut mesh, &edges, apex, &mut health);
    if health.windings_reversed > 0 || health.shells_reversed > 0 {
        edges = topology::edges(&mesh); // a reversed triangle numbers its half-edges anew
    }
    if health.one_sided_edges > 0 {
        separate_disagreeing(&mesh, &mut edges);
    }
    report_edges(&mesh, &edges, &mut health);
    match crossing(&mesh, &shell_of, &shells, tolerance) {
        Crossing::None => {}
        Crossing::Found(count, place) => {
            health.crossing_shells = count;
            health.crossing_at = Some(place);
        }
        Crossing::Unchecked => health.warnings.push(
            "whether the shells pass through each other was not checked (too many triangles)"
                .to_string(),
        ),
    }
    Ok(Repaired {
        mesh,
        health,
        edges,
        shell_of,
        shells,
        diagonal,
        noise,
        unit: scale,
        given,
        apex,
    })
}

/// Parts neighbours whose windings still disagree, so that walks over the surface never change
/// sides.
fn separate_disagreeing(mesh: &Mesh, edges: &mut Edges) {
    for half in 0..edges.twin.len() as u32 {
        let twin = edges.twin[half as usize];
        if twin != NONE && ends(&mesh.triangles, half).0 == ends(&mesh.triangles, twin).0 {
            edges.twin[half as usize] = NONE;
            edges.twin[twin as usize] = NONE;
        }
    }
}

/// Removes duplicates and needles, joins vertices and cuts edges until nothing open or tangled can
/// be mended any more.
fn mend(
    mesh: &mut Mesh,
    given: &mut Given,
    edges: &mut Edges,
    tolerance: f64,
    health: &mut Health,
) {
    // Each round may make the next one's work possible; real files need one or two.
    for _ in 0..ROUNDS {
        if edges.open.is_empty() && edges.tangled.is_empty() {
            return;
        }
        let mut changed = 0;
        let mut note = |mesh: &Mesh, edges: &mut Edges, count: usize, total: &mut usize| {
            if count > 0 {
                changed += count;
                *total += count;
                *edges = topology::edges(mesh);
            }
        };
        if !edges.tangled.is_empty() {
            let count = remove_duplicates(mesh, given);
            note(mesh, edges, count, &mut health.duplicates_removed);
        }
        let count = cracks::remove_needles(mesh, given, edges, NEEDLE * tolerance);
        note(mesh, edges, count, &mut health.degenerate_removed);
        if !edges.open.is_empty() {
            let count = cracks::join_vertices(mesh, given, edges, tolerance);
            note(mesh, edges, count, &mut health.vertices_joined);
            let count = cracks::split_edges(mesh, given, edges, tolerance);
            note(mesh, edges, count, &mut health.edges_split);
        }
        if changed == 0 {
            return;
        }
    }
}

fn report_edges(mesh: &Mesh, edges: &Edges, health: &mut Health) {
    let longest = |halves: &[u32]| {
        let span = |half: u32| {
            let (from, to) = ends(&mesh.triangles, half);
            (mesh.vertices[from as usize], mesh.vertices[to as usize])
        };
        halves
            .iter()
            .map(|&half| span(half))
            .max_by(|a, b| a.0.distance(a.1).total_cmp(&b.0.distance(b.1)))
            .map(|(a, b)| (a + b) / 2.0)
    };
    health.open_edges = edges.open.len();
    health.open_edge_at = longest(&edges.open);
    health.tangled_edges = edges.tangled.len();
    health.tangled_edge_at = longest(&edges.tangled);
    health.watertight =
        edges.open.is_empty() && edges.unpaired.is_empty() && health.one_sided_edges == 0;
}

/// Removes repeated triangles, in whatever order and sense their corners are listed. Two of
/// opposite senses in a mesh that is not two-sided throughout are the wall between two bodies glued
/// together: both go, so that one body is left. Returns how many went.
fn remove_duplicates(mesh: &mut Mesh, given: &mut Given) -> usize {
    let even = |[a, b, c]: [u32; 3]| (a < b) ^ (b < c) ^ (a < c); // sense of the corners against ascending order
    let mut keys: Vec<([u32; 3], u32)> = mesh
        .triangles
        .iter()
        .zip(0..)
        .map(|(&triangle, index)| {
            let mut key = triangle;
            key.sort_unstable();
            (key, index)
        })
        .collect();
    keys.sort_unstable();
    let mut drop = vec![false; mesh.triangles.len()];
    let mut walls = Vec::new();
    for group in keys.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        for entry in &group[1..] {
            drop[entry.1 as usize] = true;
        }
        let ups = group.iter().filter(|entry| even(mesh.triangles[entry.1 as usize])).count();
        if group.len() == 2 && ups == 1 {
            walls.push(group[0].1);
        }
    }
    // Every triangle of a two-sided mesh is such a pair; walls between bodies are the smaller part
    // of one.
    if walls.len() * 4 < mesh.triangles.len() {
        for wall in walls {
            drop[wall as usize] = true;
        }
    }
    let before = mesh.triangles.len();
    given.retain(mesh, |index, _| !drop[index]);
    before - mesh.triangles.len()
}
