//! Closing what is open only because corners that should be one differ a little, or because a
//! vertex lies on a neighbour's edge (T-junction). Only vertices and edges at openings are touched.

use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use rustc_hash::FxHashMap;

use super::Mesh;
use super::given::Given;
use super::topology::{Edges, ends};

/// End vertices of open edges, ascending.
fn open_vertices(mesh: &Mesh, open: &[u32]) -> Vec<u32> {
    let mut vertices: Vec<u32> = open
        .iter()
        .flat_map(|&half| {
            let (from, to) = ends(&mesh.triangles, half);
            [from, to]
        })
        .collect();
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// Joins vertices of open edges that lie within `tolerance` \[m\] of each other. Returns how many
/// vertices went; triangles that lose their area by it go too.
pub(super) fn join_vertices(
    mesh: &mut Mesh,
    given: &mut Given,
    edges: &Edges,
    tolerance: f64,
) -> usize {
    let cell = |point: DVec3| (point / tolerance).floor().to_array().map(|x| x as i64);
    let mut cells: FxHashMap<[i64; 3], Vec<u32>> = FxHashMap::default();
    let mut joined: FxHashMap<u32, u32> = FxHashMap::default();
    for vertex in open_vertices(mesh, &edges.open) {
        let point = mesh.vertices[vertex as usize];
        let [x, y, z] = cell(point);
        // The nearest vertex kept so far, not the first: joins do not chain along a fine boundary.
        let nearest = (0..27)
            .filter_map(|n| cells.get(&[x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1]))
            .flatten()
            .map(|&other| (mesh.vertices[other as usize].distance(point), other))
            .filter(|&(distance, _)| distance <= tolerance)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        if let Some((_, other)) = nearest {
            joined.insert(vertex, other);
        } else {
            cells.entry([x, y, z]).or_default().push(vertex);
        }
    }
    if !joined.is_empty() {
        for corner in mesh.triangles.iter_mut().flatten() {
            if let Some(&other) = joined.get(corner) {
                *corner = other;
            }
        }
        given.retain(mesh, |_, [a, b, c]| a != b && b != c && c != a);
    }
    joined.len()
}

/// Cuts open edges at the open vertices that lie on them within `tolerance` \[m\]. Returns how many
/// edges were cut. A triangle with several such edges has one cut at a call.
pub(super) fn split_edges(
    mesh: &mut Mesh,
    given: &mut Given,
    edges: &Edges,
    tolerance: f64,
) -> usize {
    let spans: Vec<(DVec3, DVec3)> = edges
        .open
        .iter()
        .map(|&half| {
            let (from, to) = ends(&mesh.triangles, half);
            (mesh.vertices[from as usize], mesh.vertices[to as usize])
        })
        .collect();
    let boxes: Vec<Aabb> =
        spans.iter().map(|&(a, b)| Aabb::new(a.min(b) - tolerance, a.max(b) + tolerance)).collect();
    let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes);
    let mut cuts: FxHashMap<u32, Vec<(f64, u32)>> = FxHashMap::default(); // half-edge -> (place along it, vertex)
    for vertex in open_vertices(mesh, &edges.open) {
        let point = mesh.vertices[vertex as usize];
        for leaf in tree.intersect_aabb(&Aabb::new(point, point)) {
            let half = edges.open[leaf as usize];
            let (from, to) = ends(&mesh.triangles, half);
            if vertex == from || vertex == to {
                continue;
            }
            let (a, b) = spans[leaf as usize];
            let along = (b - a).normalize_or_zero();
            let place = (point - a).dot(along);
            if place > tolerance
                && place < a.distance(b) - tolerance
                && point.distance(a + place * along) <= tolerance
            {
                cuts.entry(half).or_default().push((place, vertex));
            }
        }
    }
    let mut order: Vec<u32> = cuts.keys().copied().collect();
    order.sort_unstable();
    let mut count = 0;
    let mut last = None;
    for half in order {
        let triangle = half / 3;
        if last == Some(triangle) {
            continue;
        }
        last = Some(triangle);
        let Some(mut places) = cuts.remove(&half) else { continue };
        places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let corners = mesh.triangles[triangle as usize];
        let corner = (half % 3) as usize;
        let (from, to, apex) =
            (corners[corner], corners[(corner + 1) % 3], corners[(corner + 2) % 3]);
        let mut stops: Vec<u32> =
            places.into_iter().map(|(_, vertex)| vertex).filter(|&vertex| vertex != apex).collect();
        stops.dedup();
        if stops.is_empty() {
            continue;
        }
        count += 1;
        stops.push(to);
        mesh.triangles[triangle as usize] = [from, stops[0], apex];
        mesh.triangles.extend(stops.windows(2).map(|pair| [pair[0], pair[1], apex]));
        given.repeat(triangle, stops.len() - 1);
    }
    count
}

/// Removes triangles narrower than `tolerance` \[m\] that have an open or tangled edge: needles laid
/// along an edge. Returns how many went.
pub(super) fn remove_needles(
    mesh: &mut Mesh,
    given: &mut Given,
    edges: &Edges,
    tolerance: f64,
) -> usize {
    let mut tangled = std::collections::BTreeSet::new();
    for &half in &edges.tangled {
        let (from, to) = ends(&mesh.triangles, half);
        tangled.insert((from.min(to), from.max(to)));
    }
    let mut open = vec![false; mesh.triangles.len()];
    for &half in &edges.open {
        open[(half / 3) as usize] = true;
    }
    let narrow = |triangle: [u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| mesh.vertices[vertex as usize]);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        (b - a).cross(c - a).length() <= tolerance * longest
    };
    let on_tangled = |[a, b, c]: [u32; 3]| {
        [(a, b), (b, c), (c, a)].iter().any(|&(a, b)| tangled.contains(&(a.min(b), a.max(b))))
    };
    let keep: Vec<bool> = mesh
        .triangles
        .iter()
        .zip(&open)
        .map(|(&triangle, &open)| !((open || on_tangled(triangle)) && narrow(triangle)))
        .collect();
    let before = mesh.triangles.len();
    given.retain(mesh, |index, _| keep[index]);
    before - mesh.triangles.len()
}
