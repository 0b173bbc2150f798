//! The volumes that a gripper's bodies sweep: while the jaws close on the part, and along the
//! straight approach.

use glam::{DMat3, DVec3};
use parry3d_f64::query::details::intersection_test_support_map_support_map;
use parry3d_f64::shape::{SupportMap, Triangle};

use crate::gripper::{Body, Gripper, Jaw, Jaws, Shape};
use crate::model::Frame;
use crate::part::PairKind;

/// When a body meets an obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Phase {
    /// In the grip, or while the jaws close.
    Grip,
    /// On the straight way to the grip with opened jaws.
    Approach,
    /// On the way back with closed jaws.
    Retreat,
}

/// A convex body moved along a straight line: all its positions together, in the grip frame.
#[derive(Debug, Clone)]
pub(crate) struct Sweep {
    /// Name of the body.
    pub(crate) body: String,
    /// `I`, `II` for a finger body, nothing for the palm.
    pub(crate) jaw: &'static str,
    pub(crate) phase: Phase,
    /// Smallest and largest coordinates.
    pub(crate) low: DVec3,
    /// See `low`.
    pub(crate) high: DVec3,
    /// The exact volume where it is not the box between `low` and `high`.
    exact: Option<Convex>,
}

#[derive(Debug, Clone)]
struct Convex {
    body: Body,
    /// The body's way.
    path: DVec3,
    /// Half sizes of a box added all round (clearance).
    grown: DVec3,
}

/// How the jaws move.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    pub(crate) kind: PairKind,
    /// Distance of the gripped faces \[m\].
    pub(crate) width: f64,
    /// Way of each jaw from the approach opening to contact \[m\].
    pub(crate) opening: f64,
    /// Fingers may lie this deep in the planes that they grip \[m\].
    pub(crate) touch: f64,
    /// Bodies may lie this deep in any other surface \[m\]: being flush with one is no collision.
    pub(crate) flush: f64,
    /// Distance kept elsewhere \[m\].
    pub(crate) clearance: f64,
    /// Length of the approach \[m\].
    pub(crate) approach: f64,
    /// Which way round the gripper is put.
    pub(crate) jaws: Jaws,
}

/// All sweeps of a gripper, in the order in which they are tested.
pub(crate) fn sweeps(gripper: &Gripper, motion: &Motion) -> Vec<Sweep> {
    // Outside grips: jaw I stands at +x3 and opens along +x3. Inside grips: its outer pad pushes
    // face I, which lies at -x3, so it is the jaw at -x3, and it draws in along +x3 for the
    // approach.
    let is_inside = motion.kind == PairKind::Internal;
    let gap = gripper.gap_on(motion.width, is_inside);
    let way = if is_inside { -motion.opening } else { motion.opening };
    let back = motion.approach * DVec3::NEG_X;
    let turn = Frame { rotation: motion.jaws.turn(), origin: DVec3::ZERO };
    let (mut grip, mut approach) = (Vec::new(), Vec::new());
    for side in Jaw::BOTH {
        let jaw = match motion.jaws {
            Jaws::Straight => side,
            Jaws::Exchanged => side.other(),
        };
        // Away from the gripped face by the tolerance, so that lying on it is no collision.
        let outs = [motion.touch, gripper.way(jaw, way.abs()).max(motion.touch)]
            .map(|out| out * way.signum());
        let bulge = gripper.bulge(jaw, gap, outs);
        let [closed, opened] = outs.map(|out| turn.compose(&gripper.jaw_at(jaw, gap, out)));
        // Named after the face that it grips.
        let face = match motion.kind {
            PairKind::External => side.name(),
            PairKind::Internal => side.other().name(),
        };
        for body in gripper.bodies(jaw) {
            let path = opened.origin - closed.origin;
            grip.push(Sweep::new(body.moved(&closed), face, Phase::Grip, path, motion, bulge));
            approach.push(Sweep::new(
                body.moved(&opened),
                face,
                Phase::Approach,
                back,
                motion,
                0.0,
            ));
        }
    }
    for body in gripper.palm_at(gap) {
        let body = body.moved(&turn);
        grip.push(Sweep::new(body.clone(), "", Phase::Grip, DVec3::ZERO, motion, 0.0));
        approach.push(Sweep::new(body, "", Phase::Approach, back, motion, 0.0));
    }
    grip.extend(approach);
    grip
}

impl Sweep {
    /// `bulge`: how far the way leaves the straight `path` along the approach.
    fn new(
        body: Body,
        jaw: &'static str,
        phase: Phase,
        path: DVec3,
        motion: &Motion,
        bulge: f64,
    ) -> Self {
        // Clearance on all sides but along x3, where a finger may lie on its face (the touch
        // tolerance keeps it off).
        let side = motion.clearance - motion.flush;
        let grown = DVec3::new(side + bulge, side, if jaw.is_empty() { side } else { 0.0 });
        Self::grown(body, jaw, phase, path, grown)
    }

    /// The sweep along `path` with `grown` added on all sides (less where negative, as far as it is
    /// a box).
    pub(crate) fn grown(
        body: Body,
        jaw: &'static str,
        phase: Phase,
        path: DVec3,
        grown: DVec3,
    ) -> Self {
        let [mut low, mut high] = body.bounds();
        (low, high) = (low.min(low + path), high.max(high + path));
        // A box moved along one of its axes sweeps a box.
        let along_axis = path.to_array().iter().filter(|part| **part != 0.0).count() <= 1;
        let is_box = along_axis
            && matches!(body.shape, Shape::Box { .. })
            && is_axis_parallel(body.grip_from_body.rotation);
        let grown = if is_box { grown.max((low - high) * 0.499) } else { grown.max(DVec3::ZERO) };
        let exact = (!is_box).then(|| Convex { body: body.clone(), path, grown });
        Self { body: body.name, jaw, phase, low: low - grown, high: high + grown, exact }
    }

    /// Whether the sweep is exactly its box.
    pub(crate) fn is_box(&self) -> bool {
        self.exact.is_none()
    }

    /// The farthest point along `direction`.
    pub(crate) fn support_point(&self, direction: DVec3) -> DVec3 {
        match &self.exact {
            None => DVec3::select(direction.cmpge(DVec3::ZERO), self.high, self.low),
            Some(convex) => convex.local_support_point(direction),
        }
    }

    /// Whether the sweep meets the triangle (grip frame; surfaces that only touch may go either
    /// way).
    pub(crate) fn meets(&self, triangle: [DVec3; 3]) -> bool {
        if !box_meets_triangle(self.low, self.high, triangle) {
            return false;
        }
        match &self.exact {
            None => true,
            Some(convex) => {
                // GJK wants the shapes near each other's origin.
                let [a, b, c] = triangle;
                intersection_test_support_map_support_map(
                    &parry3d_f64::math::Pose::IDENTITY,
                    convex,
                    &Triangle::new(a, b, c),
                )
            }
        }
    }

    /// Whether the sweep meets the box `low..high` of another frame, `other_from_grip` being this
    /// one's frame there.
    pub(crate) fn meets_box(&self, other_from_grip: &Frame, low: DVec3, high: DVec3) -> bool {
        let placed = Placed { sweep: self, frame: *other_from_grip };
        let cuboid = parry3d_f64::shape::Cuboid::new((high - low) / 2.0);
        let pose = parry3d_f64::math::Pose::from_translation((low + high) / 2.0);
        intersection_test_support_map_support_map(&pose, &placed, &cuboid)
    }
}

impl SupportMap for Convex {
    fn local_support_point(&self, direction: DVec3) -> DVec3 {
        let mut point = self.body.support_point(direction) + self.grown.copysign(direction);
        if self.path.dot(direction) > 0.0 {
            point += self.path;
        }
        point
    }
}

struct Placed<'a> {
    sweep: &'a Sweep,
    frame: Frame,
}

impl SupportMap for Placed<'_> {
    fn local_support_point(&self, direction: DVec3) -> DVec3 {
        self.frame.point(self.sweep.support_point(self.frame.rotation.transpose() * direction))
    }
}

fn is_axis_parallel(rotation: DMat3) -> bool {
    rotation
        .to_cols_array()
        .iter()
        .all(|value| value.abs() < 1e-12 || (value.abs() - 1.0).abs() < 1e-12)
}

/// Separating axes of an axis-parallel box and a triangle (Akenine-Moeller 2001).
pub(crate) fn box_meets_triangle(low: DVec3, high: DVec3, triangle: [DVec3; 3]) -> bool {
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let [a, b, c] = triangle.map(|corner| corner - middle);
    if a.min(b).min(c).cmpgt(half).any() || a.max(b).max(c).cmplt(-half).any() {
        return false;
    }
    let normal = (b - a).cross(c - a);
    if normal.dot(a).abs() > half.dot(normal.abs()) {
        return false;
    }
    for edge in [b - a, c - b, a - c] {
        for axis in [
            DVec3::new(0.0, -edge.z, edge.y),
            DVec3::new(edge.z, 0.0, -edge.x),
            DVec3::new(-edge.y, edge.x, 0.0),
        ] {
            let (x, y, z) = (axis.dot(a), axis.dot(b), axis.dot(c));
            let reach = half.dot(axis.abs());
            if x.min(y).min(z) > reach || x.max(y).max(z) < -reach {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(range: f64) -> impl Strategy<Value = DVec3> {
        [-range..range, -range..range, -range..range].prop_map(DVec3::from_array)
    }

    /// Independent of separating axes: clips the triangle by the six planes of the box.
    fn clipped_is_left(low: DVec3, high: DVec3, triangle: [DVec3; 3]) -> bool {
        let mut ring = triangle.to_vec();
        for axis in 0..3 {
            for (sign, limit) in [(1.0, high[axis]), (-1.0, -low[axis])] {
                let value = |point: DVec3| limit - sign * point[axis];
                let mut next = Vec::new();
                for (k, &a) in ring.iter().enumerate() {
                    let b = ring[(k + 1) % ring.len()];
                    if value(a) >= 0.0 {
                        next.push(a);
                    }
                    if (value(a) >= 0.0) != (value(b) >= 0.0) {
                        next.push(a + (b - a) * (value(a) / (value(a) - value(b))));
                    }
                }
                ring = next;
            }
        }
        !ring.is_empty()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20000))]
        #[test]
        fn separating_axes_agree_with_clipping(a in vector(2.0), b in vector(2.0), c in vector(2.0), half in vector(1.0)) {
            let half = half.abs() + 1e-3;
            prop_assert_eq!(box_meets_triangle(-half, half, [a, b, c]), clipped_is_left(-half, half, [a, b, c]));
        }
    }

    fn motion() -> Motion {
        Motion {
            kind: PairKind::External,
            width: 0.02,
            opening: 0.005,
            touch: 1e-6,
            flush: 1e-6,
            clearance: 0.0,
            approach: 1.0,
            jaws: Jaws::Straight,
        }
    }

    #[test]
    fn sweeps_of_the_generic_gripper() {
        let gripper = crate::gripper::find("generic").unwrap();
        let sweeps = sweeps(&gripper, &motion());
        assert_eq!(sweeps.len(), 10);
        let tip = &sweeps[0];
        assert!(
            (tip.low.z - 0.010001).abs() < 1e-12 && (tip.high.z - 0.025).abs() < 1e-12,
            "{tip:?}"
        );
        assert!(tip.is_box() && (tip.high.x - 0.011999).abs() < 1e-12);
        let other = &sweeps[2];
        assert!((other.high.z + 0.010001).abs() < 1e-12 && other.jaw == "II");
        assert!(sweeps[5].low.x < -0.9);
    }

    proptest! {
        /// The exact test of a turned box and a cylinder against sampling: a triangle with a point
        /// well inside meets, one whose points are all beyond a plane of the shape does not.
        #[test]
        fn round_and_turned_bodies(centre in vector(0.02), u in vector(0.02), v in vector(0.02), angle in 0.0..3.0f64) {
            let frame = Frame { rotation: DMat3::from_rotation_x(angle) * DMat3::from_rotation_y(angle), origin: DVec3::new(0.001, 0.002, 0.003) };
            for shape in [Shape::Box { half: DVec3::new(0.01, 0.005, 0.008) }, Shape::Cylinder { radius: 0.006, half_height: 0.01 }] {
                let body = Body { name: "b".into(), shape: shape.clone(), grip_from_body: frame };
                let path = DVec3::new(0.0, 0.0, 0.004);
                let sweep = Sweep::new(body, "I", Phase::Grip, path, &Motion { touch: 0.0, flush: 0.0, ..motion() }, 0.0);
                prop_assert!(!sweep.is_box());
                let triangle = [centre, centre + u, centre + v];
                let inside = |point: DVec3, step: f64| {
                    let p = frame.point_inverse(point - path * step);
                    match &shape {
                        Shape::Cylinder { radius, half_height } => p.truncate().length() < radius - 1e-6 && p.z.abs() < half_height - 1e-6,
                        Shape::Box { half } => p.abs().cmplt(*half - 1e-6).all(),
                        Shape::Hull { .. } => false,
                    }
                };
                let mut sampled = false;
                for i in 0..=12 {
                    for j in 0..=(12 - i) {
                        let point = centre + u * (f64::from(i) / 12.0) + v * (f64::from(j) / 12.0);
                        sampled |= (0..=4).any(|step| inside(point, f64::from(step) / 4.0));
                    }
                }
                if sampled {
                    prop_assert!(sweep.meets(triangle));
                }
                // A separating direction found by sampling proves that they do not meet.
                let apart = (0..200).any(|k| {
                    let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / 200.0;
                    let turn = f64::from(k) * 2.399_963_229_728_653;
                    let direction = DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z);
                    triangle.iter().all(|corner| corner.dot(direction) > sweep.support_point(direction).dot(direction) + 1e-6)
                });
                if apart {
                    prop_assert!(!sweep.meets(triangle));
                }
            }
        }
    }
}
