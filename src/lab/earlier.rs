//! The earlier method that the paper improves on (its section 2 and reference \[4\]: Wolter, Volz and
//! Woo, 1984): slip centre at the centroid of the contact, uniform pressure, moments in the pad
//! plane only.
//!
//! Kept for comparison. It is right for a pure moment on a fully pressed grip and roughly right far
//! from the centre of mass; near it, it promises too much (at the centre of mass it asks for no
//! friction at all).

use glam::DVec2;

use crate::contact::{Field, Loops, Twist, friction, moments};
use crate::error::Result;
use crate::mechanics::pads::Pads;
use crate::mechanics::twist_out::{TwistOut, alpha, delta_d};
use crate::model::{Contact, Pressure, Score, Slip, Status, Wrench};
use crate::request::EarlierWeights;

/// What the earlier method knows about a contact pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centroid {
    /// Where it puts the slip centre \[m\].
    pub slip_centre: DVec2,
    /// `tau_s/(mu_s N)` \[m\]: mean distance of the contact from the slip centre.
    pub mean_radius: f64,
}

/// Slip centre and mean radius under uniform pressure; `None` unless both areas are positive.
///
/// DEVIATION: reference \[4\] speaks of one contact polygon. Where the two faces' areas differ, each
/// carries the gripping force at its own uniform pressure, and centroid and mean radius are the
/// means of the faces'.
pub fn centroid(contact: &Contact) -> Option<Centroid> {
    let all = contact.face_i.iter().chain(&contact.face_ii).flat_map(|polygon| &polygon.outer);
    let (low, high) = all
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
    let (middle, size) = ((low + high) / 2.0, (high - low).length() / 2.0);
    if !(size > 0.0 && size.is_finite()) {
        return None;
    }
    // The integrals want lengths near one.
    let areas = [&contact.face_i, &contact.face_ii]
        .map(|patch| Loops::mapped(patch, |x| (x - middle) / size));
    let weights = areas.each_ref().map(moments);
    if weights.iter().any(|m| !(m[0] > 0.0 && m[0].is_finite())) {
        return None;
    }
    let centre = weights.iter().map(|m| DVec2::new(m[1], m[2]) / m[0]).sum::<DVec2>() / 2.0;
    // Torque about the centre of a rotation about it, per unit friction and normal force.
    let radius = |area: &Loops, m: &[f64; 6]| {
        let g = friction(Field { area, p: [1.0, 0.0, 0.0] }, Twist::about(centre)).g[0];
        (g[2] - centre.x * g[1] + centre.y * g[0]) / m[0]
    };
    let mean = (radius(&areas[0], &weights[0]) + radius(&areas[1], &weights[1])) / 2.0;
    Some(Centroid { slip_centre: middle + size * centre, mean_radius: size * mean })
}

impl Centroid {
    /// The method's friction coefficient under a wrench in the grip frame: the moment about the
    /// centroid's axis over `2 Fn` times the mean radius. It sees neither the in-plane force as
    /// such nor anything out of the plane. `grip_force` is `Fn` \[N\] of each pad, positive.
    pub fn mu_s(&self, grip_force: f64, load: &Wrench) -> f64 {
        let c = self.slip_centre;
        let moment = load.moment.z + load.force.x * c.y - load.force.y * c.x;
        moment.abs() / (2.0 * grip_force * self.mean_radius)
    }
}

/// The earlier method's answer to one case in the form of all others; arguments as
/// [`crate::mechanics::solve`].
///
/// The residual is that of all seven equations, of which the method looks at the moment about the
/// slip centre and the gripping force only: how far it is from zero tells how little the answer may
/// be worth. There are no bounds.
///
/// # Errors
/// As [`crate::mechanics::solve`].
pub fn solve(contact: &Contact, distance: f64, force: f64, load: &Wrench) -> Result<Score> {
    crate::mechanics::check(contact, distance, force, load)?;
    let (Some(grip), Some(pads)) = (centroid(contact), Pads::new(contact)) else {
        return Ok(crate::mechanics::refused(Status::NoContact, 0));
    };
    let c = grip.slip_centre;
    let moment = load.moment.z + load.force.x * c.y - load.force.y * c.x;
    let mu = grip.mu_s(force, load);
    let (slip, sense) = match moment.partial_cmp(&0.0) {
        Some(std::cmp::Ordering::Greater) => (Slip::Rotation { c: c.to_array(), sense: 1 }, 1.0),
        Some(std::cmp::Ordering::Less) => (Slip::Rotation { c: c.to_array(), sense: -1 }, -1.0),
        _ => (Slip::None, 0.0),
    };
    let scaled = (c - pads.origin) / pads.length;
    let x = [scaled.x, scaled.y, 1.0 / pads.moments[0][0], 1.0 / pads.moments[1][0], 0.0, 0.0];
    let [area_i, area_ii] = pads.moments.map(|m| m[0] * pads.length * pads.length);
    Ok(Score {
        mu_s: Some(mu),
        slip: Some(slip),
        pressure: Some(Pressure { a_i0: force / area_i, a_ii0: force / area_ii, a1: 0.0, a2: 0.0 }),
        contact_area_i: area_i,
        contact_area_ii: area_ii,
        residual: super::paper::residual(&pads, &pads.load(distance, force, load), &x, sense * mu),
        evaluations: 3,
        ..crate::mechanics::refused(Status::Ok, 0)
    })
}

/// The earlier evaluation function, larger is better: `(k1 Delta_d + k2 tau_s/(mu_s N))/(D +
/// epsilon) + k3 alpha`.
///
/// `d`: distance of the faces \[m\]; `centre_of_mass`: in the pad plane, grip frame \[m\]; `D` is its
/// distance from the slip centre. `None` without contact on both faces.
pub fn evaluation(
    contact: &Contact,
    d: f64,
    centre_of_mass: DVec2,
    weights: &EarlierWeights,
) -> Option<f64> {
    let grip = centroid(contact)?;
    let w = TwistOut::new(contact).least_lever()?.width;
    let distance = grip.slip_centre.distance(centre_of_mass);
    let resistance = weights.k1 * delta_d(d, w) + weights.k2 * grip.mean_radius;
    Some(resistance / (distance + weights.epsilon) + weights.k3 * alpha(d, w, 0.0, 0.0))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::model::Polygon;

    /// Mean distance from the middle of a unit square: exact.
    const SQUARE: f64 = 0.382_597_858_232_106_346;

    fn square(x: f64, side: f64) -> Vec<Polygon> {
        let h = side / 2.0;
        vec![Polygon {
            outer: vec![
                DVec2::new(x - h, -h),
                DVec2::new(x + h, -h),
                DVec2::new(x + h, h),
                DVec2::new(x - h, h),
            ],
            holes: vec![],
        }]
    }

    fn pair(face_i: Vec<Polygon>, face_ii: Vec<Polygon>) -> Contact {
        Contact { face_i, face_ii }
    }

    #[test]
    fn mean_radius_and_friction_of_a_square() {
        for side in [1e-6, 0.02, 1.0, 1e6] {
            let grip = centroid(&pair(square(3.0 * side, side), square(3.0 * side, side))).unwrap();
            assert!((grip.mean_radius / (side * SQUARE) - 1.0).abs() < 1e-14, "{side}");
            assert!((grip.slip_centre.x / (3.0 * side) - 1.0).abs() < 1e-14);
        }
        let grip = centroid(&pair(square(0.0, 0.02), square(0.0, 0.02))).unwrap();
        let load = Wrench { force: DVec3::ZERO, moment: DVec3::new(5.0, -3.0, -0.2) };
        assert!((grip.mu_s(50.0, &load) - 0.261_371_039_717_985_4).abs() < 1e-14);
        // Figure 6: the old line is D/.382598 in units of W/(2 Fn) for unit squares.
        let bar =
            Wrench { force: DVec3::new(0.0, -4.905, 0.0), moment: DVec3::new(0.0, 0.0, -0.4905) };
        assert!((grip.mu_s(50.0, &bar) - 0.641_012_474_908_359_2).abs() < 1e-13);
    }

    #[test]
    fn answers_like_the_other_methods() {
        let contact = pair(square(0.0, 0.02), square(0.0, 0.02));
        let bar =
            Wrench { force: DVec3::new(0.0, -4.905, 0.0), moment: DVec3::new(0.0, 0.0, -0.4905) };
        let score = solve(&contact, 0.01, 50.0, &bar).unwrap();
        assert!((score.mu_s.unwrap() - 0.641_012_474_908_359_2).abs() < 1e-13);
        assert!((score.pressure.unwrap().a_i0 - 125_000.0).abs() < 1e-6);
        assert_eq!(score.slip, Some(Slip::Rotation { c: [0.0, 0.0], sense: -1 }));
        // It leaves the bar's weight out of its sums, and says so; a pure moment it solves.
        assert!((score.residual - 4.905 / 50.0).abs() < 1e-12, "{}", score.residual);
        let turn = Wrench { force: DVec3::ZERO, moment: DVec3::new(0.0, 0.0, 0.2) };
        assert!(solve(&contact, 0.01, 50.0, &turn).unwrap().residual < 1e-14);
        assert_eq!(
            solve(&pair(vec![], vec![]), 0.01, 50.0, &bar).unwrap().status,
            Status::NoContact
        );
        assert!(solve(&contact, f64::NAN, 50.0, &bar).is_err());
    }

    #[test]
    fn areas_that_differ_share_the_force() {
        // Two unit squares on each side of the middle: each point lies some distance from the
        // common centre.
        let grip = centroid(&pair(square(-2.0, 1.0), square(2.0, 1.0))).unwrap();
        assert!(grip.slip_centre.length() < 1e-15);
        assert!((grip.mean_radius - 2.021_1).abs() < 1e-3, "{}", grip.mean_radius);
        assert!(centroid(&pair(vec![], square(0.0, 1.0))).is_none());
    }

    #[test]
    fn evaluation_function_of_unit_squares() {
        let contact = pair(square(0.0, 1.0), square(0.0, 1.0));
        let weights = EarlierWeights { k1: 2.0, k2: 3.0, k3: 0.5, epsilon: 0.25 };
        let got = evaluation(&contact, 1.0, DVec2::new(3.0, 4.0), &weights).unwrap();
        let want =
            (2.0 * (2f64.sqrt() - 1.0) + 3.0 * SQUARE) / 5.25 + 0.5 * std::f64::consts::FRAC_PI_4;
        assert!((got - want).abs() < 1e-13, "{got} {want}");
        assert!(evaluation(&pair(vec![], vec![]), 1.0, DVec2::ZERO, &weights).is_none());
    }
}
