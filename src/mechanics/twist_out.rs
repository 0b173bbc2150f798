//! Twisting out of the grip about an axis in the pad plane: the levers of the two contact areas,
//! the terms `Delta_d` and `alpha` of the grip evaluation functions, and the margin against
//! twist-out under a load.
//!
//! `w(e)` is how far the two pressure resultants can be apart along the direction `e` of the pad
//! plane: the support function of the Minkowski sum `conv A_I (+) (-conv A_II)`. A part that sits
//! tilted by `phi` between flat jaws holds them `d cos phi + w sin phi` apart, and the jaws' force
//! rights it with the couple `N (w cos phi - d sin phi)`, up to the barrier `tan phi = w/d`.
//! `Delta_d` is the height of that well, `alpha` its half-width, both in the weakest direction.
//! They read the two measures that the paper takes from its reference \[4\] (Wolter, Volz and Woo,
//! 1984).

use glam::DVec2;

use crate::geometry::hull::{convex_hull, support};
use crate::model::{Contact, Ring, Wrench};

/// Levers of a pair of contact areas.
#[derive(Debug, Clone, PartialEq)]
pub struct TwistOut {
    hull_i: Ring,
    hull_ii: Ring,
    /// Outward unit normals of the Minkowski sum's edges, with the supports of its two terms in that
    /// direction.
    normals: Vec<(DVec2, [f64; 2])>,
}

/// The weakest lever of a grip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lever {
    /// `w_min` \[m\]; negative when no pressure on the areas can balance the jaws.
    pub width: f64,
    /// Direction in the pad plane in which the resultants are displaced; the part twists out about
    /// the axis across it.
    pub direction: DVec2,
}

impl TwistOut {
    /// Hulls of both areas. An area without a hull of positive area counts as no contact: see
    /// [`TwistOut::least_lever`].
    pub fn new(contact: &Contact) -> Self {
        let hull = |patch: &[crate::model::Polygon]| {
            convex_hull(
                &patch.iter().flat_map(|polygon| polygon.outer.iter().copied()).collect::<Vec<_>>(),
            )
        };
        let (hull_i, hull_ii) = (hull(&contact.face_i), hull(&contact.face_ii));
        let mut normals: Vec<DVec2> = Vec::with_capacity(hull_i.len() + hull_ii.len());
        if hull_i.len() >= 3 && hull_ii.len() >= 3 {
            for (hull, sense) in [(&hull_i, 1.0), (&hull_ii, -1.0)] {
                let edges = hull.iter().zip(hull.iter().cycle().skip(1));
                normals.extend(
                    edges
                        .filter_map(|(&a, &b)| (b - a).try_normalize())
                        .map(|t| sense * DVec2::new(t.y, -t.x)),
                );
            }
        }
        let supported = |e: DVec2| (e, [support(&hull_i, e), support(&hull_ii, -e)]);
        let normals = normals.into_iter().map(supported).collect();
        Self { hull_i, hull_ii, normals }
    }

    /// `w(e) = max over A_I of e.x - min over A_II of e.x` \[m\] for a unit vector `e`.
    pub fn lever(&self, e: DVec2) -> f64 {
        self.limit_moment(e, 1.0, 1.0)
    }

    /// `N_I h_I(e) + N_II h_II(-e)` [N m]: the largest component along `e` of `int_I p x dA -
    /// int_II p x dA` that pads with the normal forces `n_i` and `n_ii` \[N\] can take.
    pub fn limit_moment(&self, e: DVec2, n_i: f64, n_ii: f64) -> f64 {
        n_i * support(&self.hull_i, e) + n_ii * support(&self.hull_ii, -e)
    }

    /// `w_min`: the least of `w(e)` over the edges of the Minkowski sum's hull, which is its
    /// minimum over all directions wherever it is positive. `None` without contact on both faces.
    pub fn least_lever(&self) -> Option<Lever> {
        let levers =
            self.normals.iter().map(|&(direction, [i, ii])| Lever { width: i + ii, direction });
        levers.min_by(|a, b| a.width.total_cmp(&b.width))
    }

    /// The gripping force \[N\] at which [`TwistOut::margin`] is zero: with less, friction has to help.
    /// Infinite without contact.
    pub fn force(&self, load: &Wrench) -> f64 {
        let q = DVec2::new(-load.moment.y, load.moment.x);
        let pull = load.force.z / 2.0;
        let along = |&(normal, [i, ii]): &(DVec2, [f64; 2])| {
            let short = q.dot(normal) - pull * (i - ii);
            if short <= 0.0 {
                0.0
            } else if i + ii > 0.0 {
                short / (i + ii)
            } else {
                f64::INFINITY
            }
        };
        if self.normals.is_empty() {
            return f64::INFINITY;
        }
        self.normals.iter().map(along).fold(pull.abs(), f64::max)
    }

    /// Distance to twist-out under an external wrench in the grip frame: `1 - s` where the load's
    /// out-of-plane moment times `1/s` is the largest that the contact can take without friction's
    /// help; 1 for no such moment, 0 at the limit, negative beyond it. Negative infinity without
    /// contact or with a pad that carries no normal force.
    ///
    /// The pressure has to provide `q = int_I p x - int_II p x = (-M2, M1)`, and all that pads can
    /// provide is the convex set `N_I conv A_I - N_II conv A_II`. Friction shifts `q` by `mu d/2`
    /// times its difference between the faces, which is not counted here: a load just beyond the
    /// limit may still be held.
    ///
    /// DEVIATION: the limit is that along `q` itself. `w(q/|q|)` bounds it from above and equals it
    /// only where a corner of the set lies on `q`'s ray or an edge across it.
    pub fn margin(&self, grip_force: f64, load: &Wrench) -> f64 {
        let (n_i, n_ii) = (grip_force + load.force.z / 2.0, grip_force - load.force.z / 2.0);
        if !(n_i > 0.0 && n_ii > 0.0) || self.normals.is_empty() {
            return f64::NEG_INFINITY;
        }
        let q = DVec2::new(-load.moment.y, load.moment.x);
        let room = |&(normal, [i, ii]): &(DVec2, [f64; 2])| {
            let limit = n_i * i + n_ii * ii;
            let left = limit - q.dot(normal);
            // With the areas apart, a limit can be negative: then only a moment the right way makes
            // room.
            if limit == 0.0 { left * f64::INFINITY } else { left / limit.abs() }
        };
        self.normals
            .iter()
            .map(room)
            .fold(f64::INFINITY, |least, room| if room.is_nan() { 0.0 } else { least.min(room) })
    }
}

/// Levers of a contact about whose `free` axes in the pad plane the part can turn without any change
/// of the pressure: there is nothing to right there and nothing to twist out of.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeTwistOut {
    lever: TwistOut,
    free: Vec<DVec2>,
}

impl FreeTwistOut {
    /// Of what is pressed; `free` are unit vectors, none, one or two.
    pub fn new(pressed: &Contact, free: Vec<DVec2>) -> Self {
        Self { lever: TwistOut::new(pressed), free }
    }

    /// `w_min` \[m\]: along the one free axis; infinite where all are free; else
    /// [`TwistOut::least_lever`]. `None` without contact.
    pub fn least_lever(&self) -> Option<f64> {
        let least = self.lever.least_lever()?;
        Some(match self.free[..] {
            [] => least.width,
            [e] => self.lever.lever(e).min(self.lever.lever(-e)),
            _ => f64::INFINITY,
        })
    }

    /// As [`TwistOut::margin`], for the part of the moment about the axis that is not free.
    pub fn margin(&self, grip_force: f64, load: &Wrench) -> f64 {
        let whole = self.lever.margin(grip_force, load);
        let [e] = self.free[..] else {
            let all = self.free.len() == 2 && whole.is_finite();
            return if all { 1.0 } else { whole };
        };
        if !whole.is_finite() {
            return whole;
        }
        let (n_i, n_ii) = (grip_force + load.force.z / 2.0, grip_force - load.force.z / 2.0);
        let q = e.dot(DVec2::new(-load.moment.y, load.moment.x));
        let limit = self.lever.limit_moment(e * q.signum(), n_i, n_ii);
        1.0 - q.abs() / limit
    }
}

/// `Delta_d = sqrt(d^2 + w^2) - d` \[m\]: how far the jaws must be forced open to twist the part out,
/// for faces `d` apart and the least lever `w`. Zero for a lever that is not positive. For a grip
/// from inside (`d` negative) it is how far the jaws must be pressed together.
pub fn delta_d(d: f64, w: f64) -> f64 {
    match (w <= 0.0 || w.is_infinite(), d < 0.0) {
        (true, _) => 0.0,
        (_, true) => d.hypot(w) - d,
        // The same without cancellation for thin levers.
        (_, false) => w * (w / (d.hypot(w) + d)),
    }
}

/// `alpha = max(0, atan((w - 2 delta)/d) - atan mu_c)` \[rad\]: the tilt up to which closing jaws
/// right the part. `delta`: uncertainty of the part's position along the pads \[m\]; `mu_c`: friction
/// of the pads while closing.
pub fn alpha(d: f64, w: f64, delta: f64, mu_c: f64) -> f64 {
    ((w - 2.0 * delta).atan2(d) - mu_c.atan()).max(0.0)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::model::Polygon;

    fn rectangle(x: f64, y: f64, a: f64, b: f64) -> Vec<Polygon> {
        let corner = |i: f64, j: f64| DVec2::new(x + i * a / 2.0, y + j * b / 2.0);
        vec![Polygon {
            outer: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            holes: vec![],
        }]
    }

    fn pair(face_i: Vec<Polygon>, face_ii: Vec<Polygon>) -> TwistOut {
        TwistOut::new(&Contact { face_i, face_ii })
    }

    fn load(m1: f64, m2: f64, f3: f64) -> Wrench {
        Wrench { force: DVec3::new(0.0, 0.0, f3), moment: DVec3::new(m1, m2, 7.0) }
    }

    #[test]
    fn unit_squares() {
        let squares = pair(rectangle(0.0, 0.0, 1.0, 1.0), rectangle(0.0, 0.0, 1.0, 1.0));
        let w = squares.least_lever().unwrap().width;
        assert_eq!(w, 1.0);
        for (d, mu_c, want_alpha, want_delta) in [
            (1.0, 0.0, std::f64::consts::FRAC_PI_4, 2f64.sqrt() - 1.0),
            (4.0, 0.0, 0.244_978_663_126_864_14, 0.123_105_625_617_660_5),
            (0.25, 0.0, 1.325_817_663_668_032_5, 0.780_776_406_404_415_1),
            (1.0, 0.3, 0.493_941_368_919_581_2, 2f64.sqrt() - 1.0),
            (4.0, 0.3, 0.0, 0.123_105_625_617_660_5),
        ] {
            assert!(
                (alpha(d, w, 0.0, mu_c) - want_alpha).abs() < 1e-12,
                "{d} {mu_c}: {}",
                alpha(d, w, 0.0, mu_c)
            );
            assert!((delta_d(d, w) - want_delta).abs() < 1e-12, "{d}: {}", delta_d(d, w));
        }
        // The position uncertainty eats the lever from both sides.
        assert!((alpha(1.0, w, 0.25, 0.0) - 0.5f64.atan()).abs() < 1e-15);
        assert_eq!(alpha(1.0, w, 0.6, 0.0), 0.0);
        // Far thinner than wide, and far wider than thin: no cancellation.
        assert!((delta_d(1e9, 1.0) / 5e-10 - 1.0).abs() < 1e-15);
        // From inside the well starts at -d.
        assert!(
            (delta_d(-1e9, 1.0) - 2e9).abs() < 1e-6 && (delta_d(-0.75, 1.0) - 2.0).abs() < 1e-15
        );
    }

    #[test]
    fn the_force_is_the_one_without_any_margin() {
        let number = |index: u32, factor: f64| (f64::from(index) * factor).fract() * 2.0 - 1.0;
        for index in 1..40 {
            let n = |factor: f64| number(index, factor);
            let shifted = rectangle(0.3 * n(0.754_877), 0.2 * n(0.569_840), 1.5, 0.7);
            let levers = pair(rectangle(0.0, 0.0, 1.0, 1.0), shifted);
            let load = load(n(0.819_172), n(0.671_043), 0.5 * n(0.549_700));
            let force = levers.force(&load);
            assert!(levers.margin(force, &load).abs() < 1e-9 || force == load.force.z.abs() / 2.0);
            assert!(levers.margin(1.01 * force, &load) > 0.0);
            assert!(levers.margin(0.99 * force, &load) < 0.0);
        }
        assert_eq!(pair(vec![], vec![]).force(&load(0.1, 0.0, 0.0)), f64::INFINITY);
    }

    #[test]
    fn levers_of_a_rectangle_and_of_shifted_areas() {
        let bars = pair(rectangle(0.0, 0.0, 3.0, 1.0), rectangle(0.0, 0.0, 3.0, 1.0));
        let lever = bars.least_lever().unwrap();
        assert_eq!(
            (lever.width, lever.direction.x.abs(), lever.direction.y.abs()),
            (1.0, 0.0, 1.0)
        );
        let shifted = pair(rectangle(0.75, 0.0, 1.0, 1.0), rectangle(0.0, 0.0, 1.0, 1.0));
        assert_eq!(shifted.least_lever().unwrap().width, 0.25);
        let apart = pair(rectangle(5.0, 0.0, 1.0, 1.0), rectangle(0.0, 0.0, 1.0, 1.0));
        assert_eq!(apart.least_lever().unwrap().width, -4.0);
        assert_eq!(delta_d(1.0, -4.0), 0.0);
        assert_eq!(alpha(1.0, -4.0, 0.0, 0.0), 0.0);
        assert!(pair(vec![], rectangle(0.0, 0.0, 1.0, 1.0)).least_lever().is_none());
    }

    #[test]
    fn the_least_lever_is_the_least_over_all_directions() {
        let triangle = vec![Polygon {
            outer: vec![DVec2::new(-0.4, -0.3), DVec2::new(0.9, -0.1), DVec2::new(-0.2, 0.8)],
            holes: vec![],
        }];
        let both = pair(triangle, rectangle(0.1, 0.2, 1.3, 0.6));
        let least = both.least_lever().unwrap().width;
        let scan = (0..36_000)
            .map(|i| {
                both.lever(DVec2::from_angle(f64::from(i) * 1e-2 * std::f64::consts::PI / 180.0))
            })
            .fold(f64::INFINITY, f64::min);
        assert!(least <= scan && scan < least + 1e-3, "{least} {scan}");
    }

    #[test]
    fn margin_counts_down_to_the_limit_of_a_square() {
        // Side s, gripping force Fn: no contact beyond |M1| = Fn s.
        let squares = pair(rectangle(0.0, 0.0, 0.02, 0.02), rectangle(0.0, 0.0, 0.02, 0.02));
        for (m1, m2, want) in [
            (0.0, 0.0, 1.0),
            (0.6, 0.0, 0.4),
            (-0.99, 0.0, 0.01),
            (0.0, 1.1, -0.1),
            (0.45, -0.4, 0.55),
        ] {
            let got = squares.margin(50.0, &load(m1, m2, 0.0));
            assert!((got - want).abs() < 1e-12, "{m1} {m2}: {got}");
        }
        // The normal forces shift with F3 but a square's limit is symmetric.
        assert!((squares.margin(50.0, &load(0.6, 0.0, 50.0)) - 0.4).abs() < 1e-12);
        assert_eq!(squares.margin(50.0, &load(0.0, 0.0, 100.0)), f64::NEG_INFINITY);
        // Off the axes the limit is that along the moment: a corner of the set, not the support in
        // its direction.
        let m = load(0.5, 0.25, 0.0);
        assert!((squares.margin(50.0, &m) - 0.5).abs() < 1e-12);
        assert!(
            1.0 - 0.5f64.hypot(0.25)
                / squares.limit_moment(DVec2::new(-0.25, 0.5).normalize(), 50.0, 50.0)
                > 0.5
        );
    }

    #[test]
    fn areas_apart_hold_only_under_the_right_moment() {
        let apart = pair(rectangle(5.0, 0.0, 1.0, 1.0), rectangle(0.0, 0.0, 1.0, 1.0));
        assert!(apart.margin(1.0, &load(0.0, 0.0, 0.0)) < 0.0);
        // q = (-M2, M1) = (5, 0) lies in the middle of what the pads can give.
        assert!(apart.margin(1.0, &load(0.0, -5.0, 0.0)) > 0.0);
        assert!(apart.margin(1.0, &load(0.0, 5.0, 0.0)) < 0.0);
    }
}
