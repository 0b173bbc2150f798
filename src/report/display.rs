//! The part as the page draws it: decimated, with shading normals and feature edges, quantised.

use std::borrow::Cow;

use glam::DVec3;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::TriMesh;
use rayon::prelude::*;

use super::decimate::decimate;
use crate::part::Mesh;

/// Triangles that a laptop's integrated graphics turns smoothly and that keep the page a few
/// megabytes small.
pub(super) const TRIANGLE_BUDGET: usize = 150_000;
/// Faces that meet at a larger angle than 30 degrees are drawn with a sharp edge between them.
const CREASE_COSINE: f64 = 0.866_025_403_784_438_6;
/// A vertex with more triangles than this is the hub of a fan; averaging over all of them would
/// cost their square.
const LARGEST_SMOOTHED_FAN: usize = 256;
/// Removed vertices on which the deviation of a decimated surface is measured.
const DEVIATION_SAMPLES: usize = 20_000;

/// A surface ready for the graphics processor. Position = `origin + scale * value / 65535`.
#[derive(Debug, Default)]
pub(super) struct Display {
    /// Smallest corner \[m\].
    pub(super) origin: DVec3,
    /// Length of the 65,535 steps \[m\]; the same along each axis.
    pub(super) scale: f64,
    /// Three steps per vertex.
    pub(super) positions: Vec<u16>,
    /// Unit normal times 127 and a zero, per vertex.
    pub(super) normals: Vec<i8>,
    /// Triangles as vertex numbers.
    pub(super) triangles: Vec<u32>,
    /// Feature edges as pairs of vertex numbers.
    pub(super) edges: Vec<u32>,
    /// Triangles of the part.
    pub(super) original: usize,
    /// Largest distance of a vertex left out from the surface shown, over up to
    /// [`DEVIATION_SAMPLES`] of them \[m\].
    pub(super) deviation: f64,
}

impl Display {
    /// The drawable form of `mesh` with at most about `budget` triangles; `None` when it has no
    /// usable triangle.
    pub(super) fn new(mesh: &Mesh, budget: usize) -> Option<Self> {
        let usable = |t: &[u32; 3]| {
            t.iter().all(|&i| mesh.vertices.get(i as usize).is_some_and(|v| v.is_finite()))
        };
        let whole: Cow<'_, [[u32; 3]]> = if mesh.triangles.iter().all(usable) {
            Cow::Borrowed(&mesh.triangles)
        } else {
            mesh.triangles.iter().copied().filter(usable).collect()
        };
        if whole.is_empty() {
            return None;
        }
        let shown = if whole.len() > budget {
            // Unreferenced vertices may be anything: only those in use go further.
            let (vertices, triangles) = compact(&mesh.vertices, &whole);
            let few = decimate(&vertices, &triangles, budget);
            let deviation = deviation(&vertices, &few);
            Self { deviation, ..Self::shaded(&vertices, &few) }
        } else {
            let (vertices, triangles) = compact(&mesh.vertices, &whole);
            Self::shaded(&vertices, &triangles)
        };
        Some(Self { original: mesh.triangles.len(), ..shown })
    }

    /// Splits the vertices along creases, so that each has one normal, and quantises.
    fn shaded(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let (low, high) = triangles.iter().flatten().fold(
            (DVec3::INFINITY, DVec3::NEG_INFINITY),
            |(low, high), &i| {
                let v = vertices[i as usize];
                (low.min(v), high.max(v))
            },
        );
        let scale = (high - low).max_element().max(f64::MIN_POSITIVE);
        let mut display = Self { origin: low, scale, ..Self::default() };
        // Length = twice the area: large triangles decide the normal of a vertex.
        let normals: Vec<DVec3> = triangles
            .iter()
            .map(|t| t.map(|i| vertices[i as usize]))
            .map(|[a, b, c]| (b - a).cross(c - a))
            .collect();
        let units: Vec<DVec3> = normals.iter().map(|n| n.normalize_or_zero()).collect();
        let mut corners: Vec<(u32, u32, u8)> = triangles
            .iter()
            .enumerate()
            .flat_map(|(t, corners)| (0..3).map(move |k| (corners[k as usize], t as u32, k)))
            .collect();
        corners.sort_unstable();
        display.triangles = vec![0; triangles.len() * 3];
        let mut drawn_as = vec![0u32; vertices.len()];
        for run in corners.chunk_by(|a, b| a.0 == b.0) {
            let vertex = run[0].0;
            let first = display.positions.len() / 3;
            drawn_as[vertex as usize] = first as u32;
            let steps = ((vertices[vertex as usize] - low) / scale * 65535.0).round();
            for &(_, t, k) in run {
                let own = units[t as usize];
                let near =
                    run.iter().filter(|other| units[other.1 as usize].dot(own) > CREASE_COSINE);
                let sum: DVec3 = if run.len() > LARGEST_SMOOTHED_FAN {
                    own
                } else {
                    near.map(|other| normals[other.1 as usize]).sum()
                };
                let n = (if sum == DVec3::ZERO { own } else { sum.normalize_or_zero() } * 127.0)
                    .round();
                let normal = [n.x as i8, n.y as i8, n.z as i8, 0];
                let known =
                    display.normals[first * 4..].chunks_exact(4).position(|known| known == normal);
                let index = first
                    + known.unwrap_or_else(|| {
                        display.positions.extend([steps.x as u16, steps.y as u16, steps.z as u16]);
                        display.normals.extend(normal);
                        display.normals.len() / 4 - 1 - first
                    });
                display.triangles[t as usize * 3 + usize::from(k)] = index as u32;
            }
        }
        display.edges = feature_edges(triangles, &units)
            .into_iter()
            .flatten()
            .map(|v| drawn_as[v as usize])
            .collect();
        display
    }
}

/// The same triangles over the vertices that they use.
fn compact(vertices: &[DVec3], triangles: &[[u32; 3]]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut number = vec![u32::MAX; vertices.len()];
    let mut used = Vec::new();
    let renumbered = triangles.iter().map(|t| {
        t.map(|i| {
            let slot = &mut number[i as usize];
            if *slot == u32::MAX {
                *slot = used.len() as u32;
                used.push(vertices[i as usize]);
            }
            *slot
        })
    });
    let renumbered = renumbered.collect();
    (used, renumbered)
}

/// Edges with one triangle, or more than two, or between faces that meet at more than the crease
/// angle.
fn feature_edges(triangles: &[[u32; 3]], units: &[DVec3]) -> Vec<[u32; 2]> {
    let mut edges: Vec<(u32, u32, u32)> = triangles
        .iter()
        .enumerate()
        .flat_map(|(t, c)| {
            (0..3).map(move |k| (c[k].min(c[(k + 1) % 3]), c[k].max(c[(k + 1) % 3]), t as u32))
        })
        .collect();
    edges.par_sort_unstable();
    let sharp = |run: &&[(u32, u32, u32)]| match run {
        [(_, _, s), (_, _, t)] => {
            units[*s as usize].dot(units[*t as usize]) < CREASE_COSINE
                && units[*s as usize] != DVec3::ZERO
                && units[*t as usize] != DVec3::ZERO
        }
        _ => true,
    };
    edges
        .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
        .filter(sharp)
        .map(|run| [run[0].0, run[0].1])
        .collect()
}

/// Largest distance from a sample of `vertices` to the surface.
fn deviation(vertices: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let Ok(surface) = TriMesh::new(vertices.to_vec(), triangles.to_vec()) else { return 0.0 };
    let step = vertices.len().div_ceil(DEVIATION_SAMPLES).max(1);
    vertices
        .par_iter()
        .step_by(step)
        .map(|&v| surface.distance_to_local_point(v, false))
        .reduce(|| 0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> Mesh {
        let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        Mesh { vertices, triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] }
    }

    #[test]
    fn sharp_corners_are_split_and_all_edges_drawn() {
        let display = Display::new(&tetrahedron(), 100).unwrap();
        assert_eq!((display.positions.len(), display.normals.len()), (12 * 3, 12 * 4));
        assert_eq!((display.triangles.len(), display.edges.len()), (12, 12));
        assert_eq!((display.original, display.scale, display.deviation), (4, 1.0, 0.0));
        assert!(display.triangles.iter().chain(&display.edges).all(|&i| (i as usize) < 12));
    }

    #[test]
    fn a_decimated_gear_stays_a_gear() {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data/parts/spur_gear.stl");
        let part = crate::part::Part::read(&path, &crate::part::ReadOptions::default()).unwrap();
        let (low, high) = part.mesh.bounding_box();
        let display = Display::new(&part.mesh, 1000).unwrap();
        assert!(
            display.triangles.len() <= 3 * 1000 && display.original == part.mesh.triangles.len()
        );
        // Measured: 9e-4 of the size.
        let share = display.deviation / (high - low).length();
        assert!(share > 0.0 && share < 2e-3, "{share}");
    }

    #[test]
    fn unusable_triangles_are_left_out() {
        let mut mesh = tetrahedron();
        mesh.vertices.push(DVec3::NAN);
        mesh.triangles.extend([[0, 1, 4], [0, 1, 99]]);
        assert_eq!(Display::new(&mesh, 100).unwrap().triangles.len(), 12);
        mesh.triangles.drain(..4);
        assert!(Display::new(&mesh, 100).is_none());
        assert!(Display::new(&Mesh::default(), 100).is_none());
    }
}
