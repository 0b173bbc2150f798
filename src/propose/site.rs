//! From antiparallel face pairs to sites: a stretch of two facing planes where pads can be put, with its own frame,
//! positions and approach angles.
//!
//! One pad may touch several faces that lie in one plane, so pairs whose planes coincide are joined first, and split
//! again into stretches too far apart for one pad.

use glam::{DMat3, DVec2, DVec3};

use super::ProposeOptions;
use super::patch::PatchIndex;
use crate::geometry::polygon::{self, Bounds2, rings};
use crate::geometry::{contains, overlay};
use crate::gripper::Gripper;
use crate::model::{Frame, Patch, Polygon};
use crate::part::{FacePair, PairKind, Part, PlanarFace};

/// Planes whose directions differ by less count as one direction, which saves a tree [rad]: 0.1 um on 100 mm.
const SAME_DIRECTION: f64 = 1e-6;
/// Faces within this distance of one plane, as a share of the part's diagonal, lie in one plane: twice the tolerance of
/// the planes themselves.
const SAME_PLANE: f64 = 2e-5;
/// Corners of the overlap that turn by less are points of a tessellated curve, not places of their own.
const CORNER: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// At most this many corners of one site become positions.
const MOST_CORNERS: usize = 200;
/// At most this many edge directions of one site become approach angles (four each).
const MOST_EDGE_DIRECTIONS: usize = 4;

/// A stretch of two facing planes.
#[derive(Debug)]
pub(super) struct Site {
    pub(super) kind: PairKind,
    /// Site frame in the part frame: `z` the closing axis (outward normal of face I), the origin midway between the planes.
    pub(super) part_from_site: Frame,
    /// Distance of the planes [m].
    pub(super) width: f64,
    /// Index into the list of directions.
    pub(super) direction: usize,
    /// Origin in the axes of the direction.
    pub(super) origin: DVec3,
    /// Angle of the site's `x` in the axes of the direction [rad].
    pub(super) turn: f64,
    /// Gripped faces on side I and II.
    pub(super) faces: [Vec<u32>; 2],
    /// How far the faces rise above the pads' planes [m]: their tilt and roughness.
    pub(super) rise: f64,
    /// Roughness of a plane [m].
    pub(super) flush: f64,
    /// Area in which the two planes' faces overlap [m^2].
    pub(super) overlap: f64,
    /// Grip origins, in the site's `(x, y)` [m].
    pub(super) positions: Vec<DVec2>,
    /// Approach angles from the site's `x` [rad].
    pub(super) angles: Vec<f64>,
    /// Bounds of the positions.
    pub(super) bounds: Bounds2,
}

/// Axes of a closing direction: rows of the matrix are the axes in the part frame, the third is the direction.
pub(super) fn axes(direction: DVec3) -> DMat3 {
    let side = if direction.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let x = (side - direction * direction.dot(side)).normalize();
    DMat3::from_cols(x, direction.cross(x), direction).transpose()
}

/// Sites and their directions, in a stable order: by falling overlap of their largest pair.
pub(super) fn sites(part: &Part, gripper: &Gripper, options: &ProposeOptions, pairs: &[FacePair]) -> (Vec<Site>, Vec<DVec3>) {
    let (low, high) = part.mesh.bounding_box();
    let size = (high - low).length();
    let planes = Planes::new(&part.faces, SAME_PLANE * size);
    let mut groups: Vec<(usize, usize, PairKind, Vec<&FacePair>)> = Vec::new();
    let mut group_of = rustc_hash::FxHashMap::default();
    for pair in pairs {
        let (a, b) = (planes.of[pair.face_i as usize], planes.of[pair.face_ii as usize]);
        let key = (a.min(b), a.max(b), pair.kind);
        let group = *group_of.entry(key).or_insert_with(|| {
            groups.push((key.0, key.1, key.2, Vec::new()));
            groups.len() - 1
        });
        groups[group].3.push(pair);
    }
    let mut directions: Vec<DVec3> = Vec::new();
    let mut sites = Vec::new();
    for (_, _, kind, pairs) in &groups {
        sites.extend(group_sites(part, gripper, options, *kind, pairs, size, &mut directions));
    }
    (sites, directions)
}

/// Faces sorted into planes.
struct Planes {
    /// Plane number of each face.
    of: Vec<usize>,
}

impl Planes {
    fn new(faces: &[PlanarFace], tolerance: f64) -> Self {
        let reach = faces.iter().map(|face| face.centroid.length()).fold(0.0, f64::max);
        // Sorted by offset, only a window can match: tilts of 1e-3 move the offset by that much of the reach.
        let mut sorted: Vec<&PlanarFace> = faces.iter().collect();
        sorted.sort_by(|a, b| a.offset.total_cmp(&b.offset).then(a.id.cmp(&b.id)));
        let offsets: Vec<f64> = sorted.iter().map(|face| face.offset).collect();
        let mut of = vec![usize::MAX; faces.len()];
        for face in faces {
            if of[face.id as usize] != usize::MAX {
                continue;
            }
            of[face.id as usize] = face.id as usize;
            let slack = tolerance + 1e-3 * reach;
            let window = offsets.partition_point(|&offset| offset < face.offset - slack)..offsets.partition_point(|&offset| offset <= face.offset + slack);
            for other in &sorted[window] {
                let same = other.normal.dot(face.normal) > 1.0 - 5e-7 && (face.normal.dot(other.centroid) - face.offset).abs() < tolerance;
                if of[other.id as usize] == usize::MAX && same {
                    of[other.id as usize] = face.id as usize;
                }
            }
        }
        Self { of }
    }
}

fn group_sites(
    part: &Part,
    gripper: &Gripper,
    options: &ProposeOptions,
    kind: PairKind,
    pairs: &[&FacePair],
    size: f64,
    directions: &mut Vec<DVec3>,
) -> Vec<Site> {
    let face = |id: u32| &part.faces[id as usize];
    let first = pairs[0];
    let mut axis = (face(first.face_i).normal - face(first.face_ii).normal).normalize();
    // Which of the two is face I is free: one sign per direction keeps the number of directions down.
    if axis[axis.abs().max_position()] < 0.0 {
        axis = -axis;
    }
    let direction = directions.iter().position(|known| known.dot(axis) > 0.0 && known.cross(axis).length() < SAME_DIRECTION).unwrap_or_else(|| {
        directions.push(axis);
        directions.len() - 1
    });
    let axis = directions[direction];
    let axes_from_part = axes(axis);
    // Sides by the sign of the normal: pairs of one group may list their faces in either order.
    let mut sides: [Vec<u32>; 2] = [Vec::new(), Vec::new()];
    for id in pairs.iter().flat_map(|pair| [pair.face_i, pair.face_ii]) {
        sides[usize::from(face(id).normal.dot(axis) < 0.0)].push(id);
    }
    for side in &mut sides {
        side.sort_unstable();
        side.dedup();
    }
    let patches = [0, 1].map(|side| project(sides[side].iter().map(|&id| face(id)), &axes_from_part));
    let overlap = overlay::intersect(&patches[0], &patches[1]);
    let bounds = Bounds2::of(&gripper.pad);
    let reach = gripper.pad.iter().map(|point| point.length()).fold(0.0, f64::max);
    let spacing = options.spacing(gripper);
    let centre = axes_from_part * part.mass_properties(1.0).centre_of_mass;

    let mut found = Vec::new();
    for overlap in stretches(overlap, 2.0 * reach) {
        let turn = main_direction(&overlap);
        let middle = {
            let turned =
                Bounds2::of(&overlap.iter().flat_map(|polygon| &polygon.outer).map(|&point| DVec2::from_angle(-turn).rotate(point)).collect::<Vec<_>>());
            DVec2::from_angle(turn).rotate(turned.centre())
        };
        let heights = heights(face(sides[0][0]), face(sides[1][0]), &axes_from_part, middle);
        let mid_height = (heights[0] + heights[1]) / 2.0;
        let origin = middle.extend(mid_height);
        let local: Patch = overlap.iter().map(|polygon| to_site(polygon, middle, turn)).collect();
        let rise = rise(&sides, part, &axes_from_part, axis, &overlap, heights) + SAME_PLANE * size;
        let centre_of_mass = DVec2::from_angle(-turn).rotate(centre.truncate() - middle);
        let positions = positions(&local, spacing, bounds.size().max_element() / 2.0, centre_of_mass);
        let angles = angles(&local, options, bounds.size().min_element());
        let frame = Frame { rotation: axes_from_part.transpose() * DMat3::from_rotation_z(turn), origin: axes_from_part.transpose() * origin };
        found.push(Site {
            kind,
            part_from_site: frame,
            width: (heights[0] - heights[1]).abs(),
            direction,
            origin,
            turn,
            faces: sides.clone(),
            rise,
            flush: SAME_PLANE * size,
            overlap: polygon::patch_area(&local),
            bounds: Bounds2::of(&positions),
            positions,
            angles,
        });
    }
    found
}

impl Site {
    /// The two gripped planes' faces, indexed in the site's `(x, y)` for pads that reach `reach` from their origin; only
    /// one when both are the same.
    pub(super) fn patches(&self, part: &Part, axes_from_part: &DMat3, reach: f64) -> Vec<PatchIndex> {
        let [side_i, side_ii] = [0, 1].map(|side| -> Patch {
            let faces = self.faces[side].iter().map(|&id| &part.faces[id as usize]);
            project(faces, axes_from_part).iter().map(|polygon| to_site(polygon, self.origin.truncate(), self.turn)).collect()
        });
        let same = same_shape(&side_i, &side_ii, 1e-9 * reach);
        let index = |patch: Patch| PatchIndex::new(patch, self.bounds.grown(1.01 * reach), reach / 4.0);
        if same { vec![index(side_i)] } else { vec![index(side_i), index(side_ii)] }
    }

    /// The face of a side that holds `point` of the site's plane, or the first.
    pub(super) fn face_at(&self, side: usize, part: &Part, point: DVec2) -> u32 {
        let faces = &self.faces[side];
        if faces.len() == 1 {
            return faces[0];
        }
        let point = self.part_from_site.point(point.extend(0.0));
        let holds = |&&id: &&u32| {
            let face = &part.faces[id as usize];
            let local = face.part_from_face.point_inverse(point).truncate();
            face.polygons.iter().any(|polygon| contains(polygon, local))
        };
        *faces.iter().find(holds).unwrap_or(&faces[0])
    }
}

/// Heights of the planes of side I and II above `point` of the axes' `(x, y)`.
fn heights(face_i: &PlanarFace, face_ii: &PlanarFace, axes_from_part: &DMat3, point: DVec2) -> [f64; 2] {
    [face_i, face_ii].map(|face| {
        let normal = *axes_from_part * face.normal;
        (face.offset - normal.truncate().dot(point)) / normal.z
    })
}

/// How far any of the faces rises above its pad's plane within the overlap.
fn rise(sides: &[Vec<u32>; 2], part: &Part, axes_from_part: &DMat3, axis: DVec3, overlap: &[Polygon], heights: [f64; 2]) -> f64 {
    let mut most = 0.0_f64;
    for side in 0..2 {
        for &id in &sides[side] {
            let face = &part.faces[id as usize];
            let normal = *axes_from_part * face.normal;
            let out = face.normal.dot(axis).signum();
            for point in overlap.iter().flat_map(|polygon| &polygon.outer) {
                let height = (face.offset - normal.truncate().dot(*point)) / normal.z;
                most = most.max(out * (height - heights[side]));
            }
        }
    }
    most
}

/// Faces projected along the closing axis into the axes' `(x, y)`, normalised.
fn project<'a>(faces: impl Iterator<Item = &'a PlanarFace>, axes_from_part: &DMat3) -> Patch {
    let mut patch = Patch::new();
    for face in faces {
        let place = |&point: &DVec2| (*axes_from_part * face.part_from_face.point(point.extend(0.0))).truncate();
        for shape in &face.polygons {
            let mut polygon =
                Polygon { outer: shape.outer.iter().map(place).collect(), holes: shape.holes.iter().map(|hole| hole.iter().map(place).collect()).collect() };
            polygon::normalise(&mut polygon);
            patch.push(polygon);
        }
    }
    patch
}

fn to_site(shape: &Polygon, origin: DVec2, turn: f64) -> Polygon {
    let turn = DVec2::from_angle(-turn);
    let ring = |ring: &Vec<DVec2>| ring.iter().map(|&point| turn.rotate(point - origin)).collect();
    Polygon { outer: ring(&shape.outer), holes: shape.holes.iter().map(ring).collect() }
}

/// Whether two patches have the same rings, whatever point each starts at.
fn same_shape(a: &[Polygon], b: &[Polygon], tolerance: f64) -> bool {
    let same_ring = |a: &[DVec2], b: &[DVec2]| {
        let start = b.iter().position(|point| point.distance(a[0]) <= tolerance);
        a.len() == b.len() && start.is_some_and(|start| (0..a.len()).all(|index| a[index].distance(b[(start + index) % b.len()]) <= tolerance))
    };
    let (rings_a, rings_b): (Vec<&[DVec2]>, Vec<&[DVec2]>) = (a.iter().flat_map(rings).collect(), b.iter().flat_map(rings).collect());
    let mut free = vec![true; rings_b.len()];
    rings_a.len() == rings_b.len()
        && rings_a.iter().all(|ring| {
            let found = (0..rings_b.len()).find(|&index| free[index] && same_ring(ring, rings_b[index]));
            found.is_some_and(|index| std::mem::replace(&mut free[index], false))
        })
}

/// Splits a patch where its pieces are farther apart than `gap`, so that no pad touches two of them.
fn stretches(patch: Patch, gap: f64) -> Vec<Patch> {
    let mut boxes: Vec<(Bounds2, usize)> = patch.iter().enumerate().map(|(index, polygon)| (Bounds2::of(&polygon.outer).grown(gap / 2.0), index)).collect();
    boxes.sort_by(|a, b| a.0.min.x.total_cmp(&b.0.min.x).then(a.1.cmp(&b.1)));
    let mut parent: Vec<usize> = (0..patch.len()).collect();
    fn root(parent: &mut [usize], mut index: usize) -> usize {
        while parent[index] != index {
            parent[index] = parent[parent[index]];
            index = parent[index];
        }
        index
    }
    for (position, (bounds, index)) in boxes.iter().enumerate() {
        for (other, other_index) in boxes[position + 1..].iter().take_while(|(other, _)| other.min.x <= bounds.max.x) {
            if bounds.meets(*other) {
                let (a, b) = (root(&mut parent, *index), root(&mut parent, *other_index));
                parent[a.max(b)] = a.min(b);
            }
        }
    }
    let mut stretches: Vec<(usize, Patch)> = Vec::new();
    for (index, polygon) in patch.into_iter().enumerate() {
        let root = root(&mut parent, index);
        match stretches.iter_mut().find(|(known, _)| *known == root) {
            Some((_, patch)) => patch.push(polygon),
            None => stretches.push((root, vec![polygon])),
        }
    }
    stretches.into_iter().map(|(_, patch)| patch).collect()
}

/// Directions of the boundary modulo a right angle, in `(-45, 45]` degrees, with the length that runs along each,
/// longest first.
fn edge_directions(patch: &[Polygon]) -> Vec<(f64, f64)> {
    let right_angle = std::f64::consts::FRAC_PI_2;
    let mut found: Vec<(f64, f64)> = Vec::new();
    for ring in patch.iter().flat_map(rings) {
        for (&a, &b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let length = a.distance(b);
            // Rounding must not move an edge at 45 degrees to the other end of the interval.
            let mut angle = (b - a).to_angle().rem_euclid(right_angle);
            if angle > right_angle / 2.0 + 1e-6 {
                angle -= right_angle;
            }
            found.push((angle, length));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut merged: Vec<(f64, f64)> = Vec::new();
    for (angle, length) in found {
        match merged.last_mut() {
            Some((known, sum)) if angle - *known < 1e-3 => {
                *known = (*known * *sum + angle * length) / (*sum + length).max(f64::MIN_POSITIVE);
                *sum += length;
            }
            _ => merged.push((angle, length)),
        }
    }
    // Equal lengths must not be told apart by rounding: compared in steps of a millionth of the longest.
    let longest = merged.iter().map(|direction| direction.1).fold(0.0, f64::max);
    let step = |length: f64| (length / longest.max(f64::MIN_POSITIVE) * 1e6).round();
    merged.sort_by(|a, b| step(b.1).total_cmp(&step(a.1)).then(a.0.abs().total_cmp(&b.0.abs())));
    merged
}

/// Angle of the site's `x` in the axes of the direction: along the boundary's main direction, when it has one.
fn main_direction(overlap: &[Polygon]) -> f64 {
    let perimeter: f64 = edge_directions(overlap).iter().map(|direction| direction.1).sum();
    match edge_directions(overlap).first() {
        Some(&(angle, length)) if length > 0.15 * perimeter => angle,
        _ => 0.0,
    }
}

/// Approach angles: uniform, and along the site's edges, which the uniform ones may miss.
fn angles(overlap: &[Polygon], options: &ProposeOptions, pad: f64) -> Vec<f64> {
    let turn = std::f64::consts::TAU;
    let count = (turn / options.angle_step).round().max(1.0) as usize;
    let mut angles: Vec<f64> = (0..count).map(|index| turn * index as f64 / count as f64).collect();
    if options.edge_angles {
        let long = edge_directions(overlap).into_iter().filter(|direction| direction.1 > pad / 2.0);
        for (direction, _) in long.take(MOST_EDGE_DIRECTIONS) {
            for quarter in 0..4 {
                let angle = (direction + f64::from(quarter) * turn / 4.0).rem_euclid(turn);
                let near = |known: &f64| {
                    let apart = (angle - known).rem_euclid(turn);
                    apart.min(turn - apart) < 2e-3
                };
                if !angles.iter().any(near) {
                    angles.push(angle);
                }
            }
        }
    }
    angles
}

/// A grid over the overlap, its corners and centroids, and the point nearest the centre of mass.
fn positions(overlap: &[Polygon], spacing: f64, reach: f64, centre_of_mass: DVec2) -> Vec<DVec2> {
    let bounds = polygon::bounds(overlap);
    let index = PatchIndex::new(overlap.to_vec(), bounds.grown(1.01 * reach), reach / 2.0);
    // The site's origin is the middle of the bounds; rounding must not cost the outermost row.
    let half = (bounds.size() / 2.0 / spacing + 1e-6).floor();
    let mut positions = Vec::new();
    let mut y = -half.y;
    while y <= half.y {
        let mut x = -half.x;
        while x <= half.x {
            let point = bounds.centre() + spacing * DVec2::new(x, y);
            if !index.is_far(point, reach / 2.0) {
                positions.push(point);
            }
            x += 1.0;
        }
        y += 1.0;
    }
    let mut extra: Vec<DVec2> = Vec::new();
    extra.push(nearest(overlap, centre_of_mass));
    extra.push(polygon::patch_moments(overlap).centroid);
    if overlap.len() > 1 {
        extra.extend(overlap.iter().map(|polygon| polygon::moments(polygon).centroid));
    }
    let mut corners = Vec::new();
    for ring in overlap.iter().flat_map(rings) {
        for index in 0..ring.len() {
            let [a, b, c] = [0, 1, 2].map(|step| ring[(index + step) % ring.len()]);
            if (b - a).angle_to(c - b).abs() > CORNER {
                corners.push(b);
            }
        }
    }
    if corners.len() <= MOST_CORNERS {
        extra.extend(corners);
    }
    let near = 1e-4 * spacing;
    let on_grid = |point: DVec2| {
        let steps = (point - bounds.centre()) / spacing;
        (steps - steps.round()).length() * spacing < near && steps.abs().cmple(half + 1e-3).all()
    };
    for point in extra {
        let useful = point.is_finite() && !index.is_far(point, reach / 2.0);
        if useful && !on_grid(point) && !positions.iter().rev().take(2 * MOST_CORNERS + 8).any(|known| known.distance(point) < near) {
            positions.push(point);
        }
    }
    positions
}

/// The point of the patch nearest to `point`.
fn nearest(patch: &[Polygon], point: DVec2) -> DVec2 {
    if patch.iter().any(|polygon| contains(polygon, point)) {
        return point;
    }
    let mut best = (f64::INFINITY, point);
    for ring in patch.iter().flat_map(rings) {
        for (&a, &b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let t = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            let foot = a + (b - a) * t;
            if foot.distance(point) < best.0 {
                best = (foot.distance(point), foot);
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::rectangle;

    fn shape(ring: Vec<DVec2>) -> Polygon {
        Polygon { outer: ring, holes: Vec::new() }
    }

    #[test]
    fn positions_cover_a_rectangle_and_its_special_points() {
        let face = [shape(rectangle(DVec2::new(0.1, 0.04)))];
        let found = positions(&face, 0.01, 0.01, DVec2::new(0.2, 0.003));
        // 11 x 5 grid points, corners among them; the point nearest the centre of mass is not
        assert_eq!(found.len(), 56, "{found:?}");
        assert!(found.iter().any(|point| point.distance(DVec2::new(0.05, 0.003)) < 1e-12));
    }

    #[test]
    fn positions_leave_out_what_no_pad_reaches() {
        let corners = [(-1., -1.), (1., -1.), (1., -0.9), (-0.9, -0.9), (-0.9, 1.), (-1., 1.)];
        let l_shape = [shape(corners.iter().map(|&(x, y)| DVec2::new(x, y)).collect())];
        let found = positions(&l_shape, 0.05, 0.1, DVec2::ZERO);
        assert!(found.len() > 200 && found.len() < 900, "{}", found.len());
        assert!(!found.iter().any(|point| point.min_element() > -0.5));
    }

    #[test]
    fn far_pieces_become_sites_of_their_own() {
        let at = |x: f64| shape(rectangle(DVec2::ONE).iter().map(|&point| point + DVec2::X * x).collect());
        let split = stretches(vec![at(0.0), at(10.0), at(1.5), at(11.0)], 1.0);
        assert_eq!(split.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2]);
        assert!(stretches(Vec::new(), 1.0).is_empty());
    }

    #[test]
    fn the_main_direction_is_that_of_the_edges() {
        for degrees in [-44.0_f64, -10.0, 0.0, 10.0, 44.0] {
            let angle = degrees.to_radians();
            let turned: Vec<DVec2> = rectangle(DVec2::new(3.0, 1.0)).iter().map(|&point| DVec2::from_angle(angle).rotate(point)).collect();
            assert!((main_direction(&[shape(turned)]) - angle).abs() < 1e-9, "{degrees}");
        }
        let circle: Vec<DVec2> = (0..64).map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / 64.0)).collect();
        assert_eq!(main_direction(&[shape(circle)]), 0.0);
        let square = [shape(rectangle(DVec2::ONE).iter().map(|&point| DVec2::from_angle(0.2).rotate(point)).collect())];
        let options = ProposeOptions { angle_step: std::f64::consts::FRAC_PI_2, ..ProposeOptions::default() };
        let found = angles(&square, &options, 0.5);
        assert_eq!(found.len(), 8, "{found:?}");
    }

    #[test]
    fn axes_are_right_handed() {
        for direction in [DVec3::X, DVec3::Y, DVec3::NEG_Z, DVec3::new(0.6, 0.0, 0.8)] {
            let axes = axes(direction);
            assert!((axes.determinant() - 1.0).abs() < 1e-12 && (axes * direction - DVec3::Z).length() < 1e-12);
        }
    }
}
