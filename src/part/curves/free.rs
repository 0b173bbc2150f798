//! Smooth surface of free form: gently bending triangles of no plane and no round face.

use glam::{DMat3, DVec3};
use rustc_hash::FxHashSet;

use super::find::sort;
use super::{CurvedFace, Shape};
use crate::geometry::{Paraboloid, UnionFind};
use crate::part::FaceSource;
use crate::part::orient::Role;
use crate::part::regions::{Regions, twice_normal};
use crate::part::repair::Repaired;
use crate::part::topology::NONE;

/// Cosine of the greatest angle between neighbouring triangles of one surface: 25 degrees, as
/// between facets of round faces.
const SMOOTH: f64 = 0.906_307_787_036_65;
/// Facets that show a form.
const MANY: usize = 24;
/// Facets that show one if all bend the same way: a plane that noise has broken up bends both ways.
const FEW: usize = 4;
/// Share of the part's surface below which many facets, and few, are told from no blend.
const LEAST: f64 = 0.01;
const LARGE: f64 = 0.04;
/// Cosine of the angle that some normal must differ by from the mean: 0.1 degrees.
const BENT: f64 = 0.999_998_476_913_288;
/// Places at which the surface is tried, and vertices about each at least: twice what makes a
/// paraboloid.
const PLACES: usize = 200;
const AROUND: usize = 12;
/// Distance of these vertices from a paraboloid as a share of that from a plane up to which they
/// are smooth. Random ones: 0.9.
const FORM: f64 = 0.35;
/// The same where the surface does not bend, over what it bends elsewhere (median).
const INFLECTION: f64 = 0.1;
/// Share of the places that must be smooth.
const SHARE: f64 = 0.9;

/// The smooth regions of free form among triangles that belong to no face, by falling area, not
/// numbered yet: connected under less than 25 degrees, bent by 0.1 degrees or more, of 24 facets and
/// 1 % of the part's surface or more, and smooth: about nine of ten vertices the others lie off a
/// paraboloid by less than 35 % of what they lie off a plane. Noise is as far from either. Of four
/// facets and 4 % of the surface, too, where all bend the same way: a gently arched plate shows too
/// little of a circle to be a cylinder.
pub(in crate::part) fn free_faces(
    part: &Repaired,
    regions: &Regions,
    is_taken: &[bool],
) -> Vec<CurvedFace> {
    let mesh = &part.mesh;
    let count = mesh.triangles.len();
    let twice = |triangle: usize| twice_normal(mesh.corners(triangle as u32));
    let total: f64 = (0..count).map(|triangle| 0.5 * twice(triangle).length()).sum();
    let loose: Vec<u32> = (0..count as u32).filter(|&t| !is_taken[t as usize]).collect();
    if loose.len() < FEW {
        return Vec::new();
    }
    let mut sets = UnionFind::new(count);
    for &triangle in &loose {
        let normal = twice(triangle as usize).normalize_or_zero();
        for half in 3 * triangle..3 * triangle + 3 {
            let twin = part.edges.twin[half as usize];
            if twin == NONE || twin / 3 > triangle || is_taken[(twin / 3) as usize] {
                continue;
            }
            let other = twice((twin / 3) as usize).normalize_or_zero();
            // A sliver has no normal to go by.
            if normal.dot(other) >= SMOOTH || normal == DVec3::ZERO || other == DVec3::ZERO {
                sets.join(triangle as usize, (twin / 3) as usize);
            }
        }
    }
    let mut groups: Vec<(usize, u32)> =
        loose.iter().map(|&triangle| (sets.root(triangle as usize), triangle)).collect();
    groups.sort_unstable();
    let mut found: Vec<CurvedFace> = groups
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|group| group.len() >= FEW)
        .map(|group| group.iter().map(|entry| entry.1).collect::<Vec<u32>>())
        .filter_map(|triangles| {
            let facets: FxHashSet<u32> =
                triangles.iter().map(|&t| regions.of[t as usize]).collect();
            match facets.len() {
                MANY.. => describe(part, triangles, LEAST * total, smooth),
                FEW.. => describe(part, triangles, LARGE * total, |part, triangles| {
                    bulges(part, regions, triangles)
                }),
                _ => None,
            }
        })
        .collect();
    sort(&mut found, part.diagonal);
    found
}

/// The face of these triangles, `least` [m^2] or more of them; `form`: whether it bulges outwards, none
/// for no form.
fn describe(
    part: &Repaired,
    triangles: Vec<u32>,
    least: f64,
    form: impl Fn(&Repaired, &[u32]) -> Option<bool>,
) -> Option<CurvedFace> {
    let mesh = &part.mesh;
    let (mut area, mut centroid, mut sum) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for &triangle in &triangles {
        let [a, b, c] = mesh.corners(triangle);
        let twice = twice_normal([a, b, c]);
        let own = 0.5 * twice.length();
        area += own;
        centroid += (a + b + c) / 3.0 * own;
        sum += twice;
    }
    if area < least {
        return None;
    }
    let mean = sum.normalize_or_zero();
    let is_bent = triangles
        .iter()
        .any(|&triangle| twice_normal(mesh.corners(triangle)).normalize_or_zero().dot(mean) < BENT);
    let outside = if is_bent { form(part, &triangles)? } else { return None };
    let shell = part.shell_of[triangles[0] as usize];
    Some(CurvedFace {
        id: 0,
        shape: Shape::Freeform,
        outside,
        residual: 0.0,
        facets: None,
        source: FaceSource::Mesh,
        fit: None,
        area,
        centroid: centroid / area,
        triangles,
        shell,
        reachable: part.shells[shell as usize].role == Role::Body,
    })
}

/// Whether all facets of a region bulge outwards, or all inwards.
fn bulges(part: &Repaired, regions: &Regions, triangles: &[u32]) -> Option<bool> {
    let mesh = &part.mesh;
    let normal = |triangle: u32| twice_normal(mesh.corners(triangle)).normalize_or_zero();
    let of = |triangle: u32| regions.of[triangle as usize];
    let (mut outwards, mut inwards) = (0, 0);
    for &triangle in triangles {
        for half in 3 * triangle..3 * triangle + 3 {
            let twin = part.edges.twin[half as usize];
            if twin == NONE
                || of(twin / 3) == of(triangle)
                || triangles.binary_search(&(twin / 3)).is_err()
            {
                continue;
            }
            let apex = mesh.corners(twin / 3)[((twin + 2) % 3) as usize];
            let fall = normal(triangle).dot(apex - mesh.corners(triangle)[0]);
            *(if fall < 0.0 { &mut outwards } else { &mut inwards }) += 1;
        }
    }
    match (outwards, inwards) {
        (1.., 0) => Some(true),
        (0, 1..) => Some(false),
        _ => None,
    }
}

/// Whether a region is smooth, and then whether most of it bulges outwards.
fn smooth(part: &Repaired, triangles: &[u32]) -> Option<bool> {
    let mesh = &part.mesh;
    // The triangles about each vertex.
    let mut about: Vec<(u32, u32)> = triangles
        .iter()
        .flat_map(|&triangle| mesh.triangles[triangle as usize].map(|vertex| (vertex, triangle)))
        .collect();
    about.sort_unstable();
    let of = |vertex: u32| {
        let from = about.partition_point(|entry| entry.0 < vertex);
        about[from..].iter().take_while(move |entry| entry.0 == vertex).map(|entry| entry.1)
    };
    let mut vertices: Vec<u32> = about.iter().map(|entry| entry.0).collect();
    vertices.dedup();
    let stride = vertices.len().div_ceil(PLACES);
    // Distances from a paraboloid and a plane, and the mean bend.
    let mut places: Vec<[f64; 3]> = Vec::new();
    for &vertex in vertices.iter().step_by(stride) {
        let mut near = vec![vertex];
        let mut inner = 0;
        let mut normal = DVec3::ZERO;
        // Ring after ring, so that both sides count alike.
        while inner < near.len() && near.len() < AROUND {
            let ring = inner..near.len();
            inner = near.len();
            for index in ring {
                for triangle in of(near[index]) {
                    normal += twice_normal(mesh.corners(triangle));
                    for corner in mesh.triangles[triangle as usize] {
                        if !near.contains(&corner) {
                            near.push(corner);
                        }
                    }
                }
            }
        }
        let Some(normal) = normal.try_normalize() else { continue };
        let (x, y) = normal.any_orthonormal_pair();
        let axes = DMat3::from_cols(x, y, normal).transpose();
        let origin = mesh.vertices[vertex as usize];
        let points = near.iter().map(|&v| axes * (mesh.vertices[v as usize] - origin));
        let weighted = points.clone().map(|point| (point, 1.0));
        let (Some(form), Some(plane)) =
            (Paraboloid::fit(weighted.clone()), Paraboloid::flat(weighted))
        else {
            continue;
        };
        let bend = form.bend.x_axis.x + form.bend.y_axis.y;
        places.push([form.off(points.clone()), plane.off(points), bend]);
    }
    let mut bends: Vec<f64> = places.iter().map(|place| place[1]).collect();
    bends.sort_by(f64::total_cmp);
    let median = *bends.get(bends.len() / 2)?;
    let is_smooth = |place: &&[f64; 3]| place[0] <= (FORM * place[1]).max(INFLECTION * median);
    let smooth = places.iter().filter(is_smooth).count();
    let outwards = places.iter().filter(|place| place[2] < 0.0).count();
    (smooth as f64 >= SHARE * places.len() as f64).then_some(2 * outwards > places.len())
}
