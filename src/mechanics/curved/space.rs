//! Which rotations the pressure does not resist.
//!
//! Translations along the pads and the turn about the closing axis map flat pads onto themselves.
//! A rotation about an axis in the pad plane is free if it maps both faces together onto themselves:
//! both patches on one cylinder, barrel or sphere. Then friction alone carries the moment about it.
//! For a unit rotation the normal velocity of a point is the pressure's lever `xi` about the axis;
//! it is zero on a common axis, of the size of a facet's half width on a polyhedral model of one,
//! and as large as the contact on a plane.

use glam::DVec2;
use nalgebra::{Matrix2, Matrix4, Matrix4x2, Matrix6, Matrix6x4, SymmetricEigen, Vector6};

use super::face::Pressed;

/// A rotation about an axis in the pad plane, and how the faces take it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rotation {
    /// Direction of the axis.
    pub(super) axis: DVec2,
    pub(super) kind: Kind,
}

/// How the pressure takes a rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// It holds: a plane, or surfaces without a common axis, is among the faces.
    Held,
    /// Both faces are round about it, not about one axis: it holds as far as its stiffness [N m per
    /// rad] goes, which may be negative.
    Nearly(f64),
    /// It does not resist.
    Free,
    /// It does not resist: faces of facets stand for round ones. So many would make the full round.
    Facets(f64),
}

/// Lever of the pressure about an axis, over its root mean square distance from its middle across
/// the axis, up to which both faces are on one axis.
const ON_AXIS: f64 = 1e-6;
/// The same for faces of facets. On one plane, however it lies, the two are the same; on facets as
/// wide as the contact of the round face that they stand for it is about 0.98 of it. Wider ones
/// hold by the pressure on a single facet.
const FACETS: f64 = 0.98;

/// Motion along the axis of a rotation over its angle and the distance of the faces, from which on the
/// rotation is a screw: with pads as they are such a motion changes nothing by itself, and no surface
/// that is known here is mapped onto itself by a screw alone.
const SCREW: f64 = 1e-3;

/// A point of the pressure: `(u, omega) -> normal velocity` as coefficients, its face, its force,
/// its place and the gap's slope.
struct Point {
    c: Vector6<f64>,
    face: usize,
    p: f64,
    x: DVec2,
    slope: DVec2,
}

/// The two principal rotations of the pressure, the softer one first.
pub(super) fn rotations(faces: [&Pressed<'_>; 2], distance: f64) -> [Rotation; 2] {
    let mut points = Vec::new();
    for (k, face) in faces.iter().enumerate() {
        let (side, height) = if k == 0 { (1.0, 0.5 * distance) } else { (-1.0, -0.5 * distance) };
        face.points(|x, slope, p| {
            let normal = [slope.x, slope.y, side];
            let c = Vector6::from([
                normal[0],
                normal[1],
                normal[2],
                x.y * normal[2] - height * normal[1],
                height * normal[0] - x.x * normal[2],
                x.x * normal[1] - x.y * normal[0],
            ]);
            points.push(Point { c, face: k, p, x, slope });
        });
    }
    let mut sums = Matrix6::zeros();
    for Point { c, p, .. } in &points {
        sums += *p * c * c.transpose();
    }
    let found = |slides| principal(&sums, slides).map(|motion| (axis_of(&motion), motion));
    let mut turns = found([DVec2::X, DVec2::Y]);
    let pitch = |motion: &Vector6<f64>| {
        let [v, w] = [0, 3].map(|first| motion.fixed_rows::<3>(first).into_owned());
        v.dot(&w).abs() / w.norm_squared()
    };
    if let Some((axis, _)) = turns.iter().find(|(_, motion)| pitch(motion) > SCREW * distance.abs())
    {
        turns = found([axis.perp(), DVec2::ZERO]);
    }
    turns.map(|(axis, motion)| Rotation {
        axis,
        kind: kind(&points, faces, axis, &motion, distance),
    })
}

/// Direction of a motion's axis in the pad plane.
fn axis_of(motion: &Vector6<f64>) -> DVec2 {
    let axis = DVec2::new(motion[3], motion[4]);
    // One sense for the same axis.
    if axis.x < -1e-9 || axis.x.abs() <= 1e-9 && axis.y < 0.0 { -axis } else { axis }
}

/// The two principal rotations by the `sums` of what the pressure does under motions, the softer one
/// first: each with the free motions that go with it, along the `slides`, along x3 and about it.
fn principal(sums: &Matrix6<f64>, slides: [DVec2; 2]) -> [Vector6<f64>; 2] {
    let mut rest = Matrix6x4::zeros();
    for (k, slide) in slides.iter().enumerate() {
        (rest[(0, k)], rest[(1, k)]) = (slide.x, slide.y);
    }
    (rest[(2, 2)], rest[(5, 3)]) = (1.0, 1.0);
    let inner = rest.transpose() * sums * rest;
    let mixed: Matrix4x2<f64> = rest.transpose() * sums.fixed_columns::<2>(3);
    let own: Matrix2<f64> = sums.fixed_view::<2, 2>(3, 3).into_owned();
    // Each coordinate in units of its own size; those that do nothing drop out.
    let units = Matrix4::from_diagonal(
        &inner.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }),
    );
    let back = SymmetricEigen::new(units * inner * units);
    let most = back.eigenvalues.amax();
    let inverse = Matrix4::from_diagonal(
        &back.eigenvalues.map(|d| if d > 1e-12 * most { 1.0 / d } else { 0.0 }),
    );
    let half = units * back.eigenvectors;
    let follow = half * inverse * half.transpose() * mixed;
    let left = own - mixed.transpose() * follow;
    let principal = SymmetricEigen::new(left);
    let order = if principal.eigenvalues[0] <= principal.eigenvalues[1] { [0, 1] } else { [1, 0] };
    order.map(|i| {
        let turn = principal.eigenvectors.column(i);
        let mut motion = -rest * follow * turn;
        (motion[3], motion[4]) = (turn[0], turn[1]);
        motion
    })
}

fn kind(
    points: &[Point],
    faces: [&Pressed<'_>; 2],
    axis: DVec2,
    motion: &Vector6<f64>,
    distance: f64,
) -> Kind {
    let across = axis.perp();
    let mut radii = [0.0; 2];
    let mut round = true;
    let steps = faces.map(|face| face.slopes(across));
    let faceted = steps.iter().any(|steps| steps.len() >= 2);
    let limit = if faceted { FACETS } else { ON_AXIS };
    let mut free = true;
    for k in 0..2 {
        // Sums over the pressure of place and slope across the axis, about the middle, and of the lever.
        let middle = across.dot(faces[k].centre());
        let mut sums = [0.0; 7];
        for Point { c, p, x, slope, .. } in points.iter().filter(|point| point.face == k) {
            let (x, s, lever) = (across.dot(*x) - middle, across.dot(*slope), c.dot(motion));
            let terms = [1.0, x, s, x * x, s * s, x * s, lever * lever];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += p * term);
        }
        let [_, x, s, xx, ss, xs, levers] = sums.map(|sum| sum / sums[0]);
        let width = (xx - x * x).max(0.0).sqrt();
        let lever = levers.sqrt() / width;
        // The round surface that fits best: x = s R.
        let (slopes, both) = ((ss - s * s).max(0.0), xs - x * s);
        radii[k] = both / slopes;
        let off =
            (width * width - 2.0 * radii[k] * both + radii[k] * radii[k] * slopes).max(0.0).sqrt();
        round &= slopes * distance * distance > 1e-12 * width * width && off <= FACETS * width;
        free &= lever <= limit;
    }
    if free && faceted {
        let gaps = steps.iter().flat_map(|steps| steps.windows(2).map(|pair| pair[1] - pair[0]));
        return Kind::Facets(std::f64::consts::TAU / gaps.fold(0.0, f64::max).atan());
    }
    if free {
        return Kind::Free;
    }
    if round && !faceted && radii.iter().all(|r| r.is_finite()) {
        let lever = |k: usize| faces[k].load * (radii[k] - 0.5 * distance);
        return Kind::Nearly(lever(0) + lever(1));
    }
    Kind::Held
}
