//! Questions asked the other way round: how hard to squeeze for a given pad friction, how much load before slip.

use crate::model::{Score, Status, Wrench};

use super::{Options, Pads, Search, solve_pads};

/// The gripping force [N] needed to hold `wrench` with the pad friction `friction`: at it `mu_s` equals `friction`, or just
/// below it the contact twists out. `None` when no force up to `1e9` times the load's size holds it (or `friction` is not positive).
///
/// `mu_s` times the force hardly changes while the contact stays whole, so the force is found by proportion in a few
/// steps. Where that does not settle (separation, several limit states) it is the smallest force from which on every
/// larger one tried holds, by search from above and bisection to 1e-9. Only limit states on the branch from `d = 0` count
/// ([`Search::Off`]), which errs towards more force.
pub fn force_needed(pads: &Pads, distance: f64, wrench: &Wrench, friction: f64, options: &Options) -> Option<f64> {
    if friction.is_nan() || friction <= 0.0 {
        return None;
    }
    let size = wrench.force.length() + wrench.moment.length() / pads.length;
    if size == 0.0 {
        return Some(0.0);
    }
    let options = Options { search: Search::Off, ..*options };
    let solve = |force: f64| solve_pads(pads, distance, force, wrench, &options);
    by_proportion(1e3 * size, friction, solve).or_else(|| from_above(size, friction, solve))
}

/// Steps of [`by_proportion`]; it settles in two where the contact stays whole.
const STEPS: usize = 12;

fn by_proportion(mut force: f64, friction: f64, solve: impl Fn(f64) -> Score) -> Option<f64> {
    for _ in 0..STEPS {
        let score = solve(force);
        let mu = score.mu_s.filter(|mu| score.status == Status::Ok && *mu > 0.0)?;
        if (mu / friction - 1.0).abs() <= 1e-10 {
            return Some(force);
        }
        force *= mu / friction;
    }
    None
}

fn from_above(size: f64, friction: f64, solve: impl Fn(f64) -> Score) -> Option<f64> {
    let holds = |force: f64| holds(&solve(force), friction);
    let mut high = size;
    while !holds(high) || !holds(2.0 * high) {
        high *= 2.0;
        if high > 1e9 * size {
            return None;
        }
    }
    let mut low = high / 1.25;
    while holds(low) {
        high = low;
        low /= 1.25;
        if low < 1e-9 * size {
            return Some(high);
        }
    }
    while high - low > 1e-9 * high {
        let middle = (low + high) / 2.0;
        if holds(middle) { high = middle } else { low = middle }
    }
    Some(high)
}

fn holds(score: &Score, friction: f64) -> bool {
    score.status.holds() && score.mu_s.is_some_and(|mu| mu <= friction)
}

/// The largest multiple of `wrench` that `friction` holds at the gripping force `force` [N] together with every smaller
/// multiple tried; infinite for no load, 0 when not even a small one holds.
///
/// Loads and forces enter only by their ratio, so this is `force / force_needed`.
pub fn load_multiple(pads: &Pads, distance: f64, force: f64, wrench: &Wrench, friction: f64, options: &Options) -> f64 {
    match force_needed(pads, distance, wrench, friction, options) {
        Some(needed) => force / needed,
        None => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::model::{Contact, Polygon};

    fn pads() -> Pads {
        let ring = [(-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01)].map(|(x, y)| DVec2::new(x, y)).to_vec();
        let patch = vec![Polygon { outer: ring, holes: Vec::new() }];
        Pads::new(&Contact { face_i: patch.clone(), face_ii: patch }).unwrap()
    }

    #[test]
    fn the_force_found_is_the_one_at_which_the_friction_just_holds() {
        let pads = pads();
        for moment in [[0.0, 0.0, 0.2], [0.3, 0.0, 0.2], [0.3, -0.2, 0.05]] {
            let wrench = Wrench { force: DVec3::new(3.0, -2.0, 1.0), moment: DVec3::from_array(moment) };
            let force = force_needed(&pads, 0.02, &wrench, 0.4, &Options::default()).unwrap();
            let at = |force: f64| solve_pads(&pads, 0.02, force, &wrench, &Options::default());
            // The last of these twists out before its mu_s comes up to the pads' friction.
            let twists_out = at(force * 0.999).status == Status::TwistedOut;
            assert!(twists_out == (moment[1] != 0.0) && (twists_out || (at(force).mu_s.unwrap() / 0.4 - 1.0).abs() < 1e-8), "{moment:?}");
            assert!(!holds(&at(force * 0.999), 0.4) && holds(&at(force * 1.001), 0.4), "{moment:?}");
            let multiple = load_multiple(&pads, 0.02, 50.0, &wrench, 0.4, &Options::default());
            let grown = Wrench { force: wrench.force * multiple, moment: wrench.moment * multiple };
            let mu = solve_pads(&pads, 0.02, 50.0, &grown, &Options::default()).mu_s.unwrap();
            assert!(if twists_out { mu < 0.4 } else { (mu / 0.4 - 1.0).abs() < 1e-8 }, "{moment:?} {multiple}");
        }
    }

    #[test]
    fn a_load_that_twists_out_without_end_needs_no_force_it_could_get() {
        let wrench = Wrench { force: DVec3::ZERO, moment: DVec3::ZERO };
        assert_eq!(force_needed(&pads(), 0.02, &wrench, 0.4, &Options::default()), Some(0.0));
        assert_eq!(force_needed(&pads(), 0.02, &wrench, 0.0, &Options::default()), None);
    }
}
