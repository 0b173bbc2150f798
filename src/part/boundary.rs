//! The boundary of a planar region as polygons with holes.

use glam::{DVec2, DVec3};
use rustc_hash::FxHashMap;

use super::Mesh;
use super::topology::{NONE, ends, next};
use crate::geometry::polygon::{ring_area, ring_contains};
use crate::model::{Frame, Polygon, Ring};

/// Boundary of the region's triangles (`inside` says whether a triangle belongs to it) in the
/// frame's `(x, y)`, points within `tolerance` \[m\] of the line between their neighbours left out.
pub(super) fn polygons(
    mesh: &Mesh,
    twin: &[u32],
    region: &[u32],
    inside: impl Fn(u32) -> bool,
    frame: &Frame,
    tolerance: f64,
) -> Vec<Polygon> {
    let on_boundary = |half: u32| {
        let twin = twin[half as usize];
        twin == NONE || !inside(twin / 3)
    };
    let mut pending: FxHashMap<u32, bool> = FxHashMap::default(); // boundary half-edge -> walked
    let mut starts = Vec::new();
    for &triangle in region {
        for half in triangle * 3..triangle * 3 + 3 {
            if on_boundary(half) {
                pending.insert(half, false);
                starts.push(half);
            }
        }
    }
    let mut rings = Vec::new();
    let mut chain = Vec::new();
    for start in starts {
        if pending.get(&start) != Some(&false) {
            continue;
        }
        chain.clear();
        let mut half = start;
        loop {
            match pending.get_mut(&half) {
                Some(walked) if !*walked => *walked = true,
                _ => break,
            }
            chain.push(ends(&mesh.triangles, half).0);
            // Turn about the end vertex through the region's own triangles to the next boundary
            // half-edge: where the region touches itself at a vertex this keeps to one side.
            half = next(half);
            while !on_boundary(half) {
                half = next(twin[half as usize]);
            }
        }
        split_at_repeated(&chain, |ring| {
            rings.push(simplify(&flatten(mesh, frame, ring), tolerance))
        });
    }
    assemble(rings)
}

fn flatten(mesh: &Mesh, frame: &Frame, ring: &[u32]) -> Ring {
    let flat = |point: DVec3| frame.point_inverse(point).truncate();
    ring.iter().map(|&vertex| flat(mesh.vertices[vertex as usize])).collect()
}

/// Cuts a closed chain of vertices that passes a vertex more than once into chains that do not.
fn split_at_repeated(chain: &[u32], mut emit: impl FnMut(&[u32])) {
    let mut stack: Vec<u32> = Vec::with_capacity(chain.len());
    let mut position: FxHashMap<u32, usize> = FxHashMap::default();
    for &vertex in chain {
        if let Some(&first) = position.get(&vertex) {
            emit(&stack[first..]);
            for gone in stack.drain(first + 1..) {
                position.remove(&gone);
            }
        } else {
            position.insert(vertex, stack.len());
            stack.push(vertex);
        }
    }
    emit(&stack);
}

/// Leaves out points that lie within `tolerance` of the line between their kept neighbours (Douglas
/// and Peucker's method, then a pass that drops what it kept on straight stretches). Empty when
/// nothing with an area is left.
fn simplify(ring: &[DVec2], tolerance: f64) -> Ring {
    if ring.len() < 3 {
        return Ring::new();
    }
    // The farthest point from any point is a corner of the convex hull; so is the farthest point
    // from that.
    let farthest = |from: DVec2| {
        (0..ring.len())
            .max_by(|&a, &b| {
                ring[a].distance_squared(from).total_cmp(&ring[b].distance_squared(from))
            })
            .unwrap_or(0)
    };
    let first = farthest(ring[0]);
    let second = farthest(ring[first]);
    let mut keep = vec![false; ring.len()];
    keep[first] = true;
    keep[second] = true;
    let count = ring.len();
    let mut stack =
        vec![(first, (second + count - first) % count), (second, (first + count - second) % count)];
    while let Some((from, length)) = stack.pop() {
        let (a, b) = (ring[from], ring[(from + length) % count]);
        let worst = (1..length)
            .map(|step| (distance_to_segment(ring[(from + step) % count], a, b), step))
            .max_by(|x, y| x.0.total_cmp(&y.0));
        if let Some((distance, step)) = worst
            && distance > tolerance
        {
            keep[(from + step) % count] = true;
            stack.push((from, step));
            stack.push(((from + step) % count, length - step));
        }
    }
    let mut points: Ring =
        ring.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(&point, _)| point).collect();
    let mut index = 0;
    let mut unchanged = 0;
    while points.len() > 2 && unchanged < points.len() {
        let count = points.len();
        index %= count;
        let (a, b, c) =
            (points[(index + count - 1) % count], points[index], points[(index + 1) % count]);
        if distance_to_segment(b, a, c) <= tolerance {
            points.remove(index);
            unchanged = 0;
        } else {
            index += 1;
            unchanged += 1;
        }
    }
    if points.len() < 3 { Ring::new() } else { points }
}

fn distance_to_segment(point: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let length = along.length_squared();
    if length == 0.0 {
        return point.distance(a);
    }
    let t = ((point - a).dot(along) / length).clamp(0.0, 1.0);
    point.distance(a + t * along)
}

/// Gives every hole (clockwise ring) to the smallest outer ring around it.
fn assemble(rings: Vec<Ring>) -> Vec<Polygon> {
    let (mut outers, mut holes) = (Vec::new(), Vec::new());
    for ring in rings {
        let area = ring_area(&ring);
        if area > 0.0 {
            outers.push((area, ring));
        } else if area < 0.0 {
            holes.push(ring);
        }
    }
    outers.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut polygons: Vec<Polygon> =
        outers.into_iter().map(|(_, outer)| Polygon { outer, holes: Vec::new() }).collect();
    for hole in holes {
        let owner = polygons
            .iter()
            .position(|polygon| encloses(&polygon.outer, &hole))
            .or(polygons.len().checked_sub(1));
        if let Some(owner) = owner {
            polygons[owner].holes.push(hole);
        }
    }
    polygons.reverse(); // largest first
    polygons
}

/// Whether most of the hole's edge midpoints lie inside the ring (they may touch).
fn encloses(outer: &[DVec2], hole: &[DVec2]) -> bool {
    let middles = hole.iter().zip(hole.iter().cycle().skip(1)).map(|(&a, &b)| (a + b) / 2.0);
    let inside = middles.filter(|&point| ring_contains(outer, point)).count();
    2 * inside > hole.len()
}
