//! Questions asked the other way round: how hard to squeeze for a given pad friction, how much load
//! before slip.
//!
//! Loads and forces enter the equations only by their ratio `k`, the load in units of the gripping
//! force, so both are one question: up to which `k` does the grip hold? `mu_s(k)` is `k` times a
//! constant while congruent faces are pressed all over. It rises with `k` on any faces pressed all
//! over as long as the friction coupling is weak: `D(v)` is linear in the pressure, so every
//! twist's bound `k w.v / (D_0 + k D_1)` rises. Where the pads separate it may fall again before
//! the contact twists out, and a `k` at which `mu_s` equals the pad friction need not be the
//! smallest one: there the limit is looked for from small loads upwards.

use std::cell::Cell;

use crate::model::{Score, Status, Wrench};

use super::growth::{EQUAL, End, Growth, MOST};
use super::pads::Pads;
use super::solve::{Options, Search, solve_next, solve_pads};

/// The gripping force \[N\] needed to hold `wrench` with the pad friction `friction`: every larger
/// force holds it too, and just below it the load slips (`mu_s` equals `friction`, to 1e-9), twists
/// out or pulls a pad off (to 1e-4). `None` when no force up to `1e9` times the load's size holds
/// it (or `friction` is not positive).
///
/// Limit states are those that [`solve_pads`] finds with these `options`; with
/// [`Search::Off`] only those on the branch from `d = 0`, which errs towards more force.
pub fn force_needed(
    pads: &Pads,
    distance: f64,
    wrench: &Wrench,
    friction: f64,
    options: &Options,
) -> Option<f64> {
    if friction.is_nan() || friction <= 0.0 {
        return None;
    }
    let size = wrench.force.length() + wrench.moment.length() / pads.length;
    if size == 0.0 {
        return Some(0.0);
    }
    let near = Cell::new(None);
    let solve = |k: f64| {
        let mut start = near.get();
        let score = solve_next(pads, distance, size / k, wrench, options, &mut start);
        near.set(start);
        // The path from d = 0 may end before the limit states do.
        let search = score.status == Status::TwistedOut && options.search != Search::Off;
        if search { solve_pads(pads, distance, size / k, wrench, options) } else { score }
    };
    let search = Limit { friction, solve };
    let start = START.iter().copied().find(|&k| search.holds(k))?;
    let end = near.get().map(|near| {
        Growth::new(pads, distance, size, wrench, friction, options.separation).end(start, near)
    });
    let limit = match end {
        Some(End::Slips(limit)) => limit,
        Some(End::Never) => return None,
        // Just beyond, another limit state may hold it.
        Some(End::Stops(held)) if held > start && !search.holds(held * (1.0 + FOUND_LOST)) => held,
        end => {
            let from = if let Some(End::Stops(held)) = end { held } else { start };
            let step = first_step(pads, distance, wrench, size, &search, start);
            search.upwards(from, step)?
        }
    };
    Some(size / limit)
}

/// The largest multiple of `wrench` that `friction` holds at the gripping force `force` \[N\]
/// together with every smaller multiple; infinite for no load, 0 when not even a small one is held.
///
/// The whole wrench grows, moments and normal force with it. It is one load's answer: of several
/// loads, the one with the smallest multiple need not be the one with the largest `mu_s`, because
/// `M1`, `M2` and `F3` may twist the contact out or pull a pad off long before another load slips.
pub fn load_multiple(
    pads: &Pads,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    friction: f64,
    options: &Options,
) -> f64 {
    match force_needed(pads, distance, wrench, friction, options) {
        Some(needed) => force / needed,
        None => 0.0,
    }
}

/// Loads in units of the gripping force at which the search may begin; the first is below any limit
/// of practice.
const START: [f64; 3] = [1e-3, 1e-6, 1e-9];
/// Equal steps up to the limit that small loads foretell. A window narrower than a step in which
/// the load is not held, between loads that are, can be missed.
const STEPS: u32 = 16;
/// Growth of the steps beyond it.
const GROWTH: f64 = 1.05;
/// Parts into which the step with the limit is cut, twice, before bisection.
const PARTS: u32 = 8;
/// Relative width at which the limit counts as found where the load slips.
const FOUND: f64 = 1e-9;
/// The same where it twists out or pulls a pad off. The last of a contact is smaller than doubles
/// resolve, so a much sharper limit would mean nothing; the load returned is one that was found
/// held.
const FOUND_LOST: f64 = 1e-4;

/// The search for the largest load held, in units of the gripping force.
struct Limit<S: Fn(f64) -> Score> {
    friction: f64,
    solve: S,
}

impl<S: Fn(f64) -> Score> Limit<S> {
    /// By how much the friction that `k` asks for exceeds the pads', as a share of it; `None`
    /// without a limit state.
    fn excess(&self, k: f64) -> Option<f64> {
        let score = (self.solve)(k);
        score.mu_s.filter(|_| score.status.holds()).map(|mu| mu / self.friction - 1.0)
    }

    fn holds(&self, k: f64) -> bool {
        self.excess(k).is_some_and(|excess| excess <= 0.0)
    }

    /// The smallest load above `start`, which holds, at which it holds no longer; `None` beyond
    /// [`MOST`].
    fn upwards(&self, start: f64, step: f64) -> Option<f64> {
        let (mut low, mut high) = (start, start + step);
        let mut steps = 0;
        while self.holds(high) {
            low = high;
            steps += 1;
            high = if steps < STEPS { high + step } else { high * GROWTH };
            if high > MOST {
                return None;
            }
        }
        for _ in 0..2 {
            let part = (high - low) / f64::from(PARTS);
            let bottom = low;
            for index in 1..PARTS {
                let k = bottom + part * f64::from(index);
                if !self.holds(k) {
                    high = k;
                    break;
                }
                low = k;
            }
        }
        Some(self.between(low, high))
    }

    /// The limit between a load that holds and one that does not: by false position, an end that
    /// stays counting half (Illinois), where `mu_s` is known at both, by bisection where the load
    /// ends otherwise.
    fn between(&self, mut low: f64, mut high: f64) -> f64 {
        let (mut below, mut above) = (self.excess(low).unwrap_or(-1.0), self.excess(high));
        let mut stays = 0;
        while high - low > high * above.map_or(FOUND_LOST, |_| FOUND) {
            let share = above.map_or(0.5, |above| below / (below - above));
            let k = low + share.clamp(0.01, 0.99) * (high - low);
            let excess = self.excess(k);
            if excess.is_some_and(|excess| excess.abs() <= EQUAL) {
                return k;
            }
            if let Some(excess) = excess.filter(|excess| *excess <= 0.0) {
                (low, below) = (k, excess);
                above = if stays > 0 { above.map(|above| above / 2.0) } else { above };
                stays = 1;
            } else {
                (high, above) = (k, excess);
                below = if stays < 0 { below / 2.0 } else { below };
                stays = -1;
            }
        }
        low
    }
}

/// A step up from small loads: a share of the nearest of the limits that they foretell, to slip, to
/// a pad pulled off and to twisting out.
fn first_step<S: Fn(f64) -> Score>(
    pads: &Pads,
    distance: f64,
    wrench: &Wrench,
    size: f64,
    search: &Limit<S>,
    start: f64,
) -> f64 {
    let load = pads.load(distance, size, wrench);
    let reach = pads.hulls.iter().flatten().map(|point| point.length()).fold(0.0, f64::max);
    let slip = (search.solve)(start).mu_s.map_or(f64::INFINITY, |mu| start * search.friction / mu);
    let pulled_off = 1.0 / (load.normal[0] - 1.0).abs();
    let twisted_out = 2.0 * reach / load.moment[0].hypot(load.moment[1]);
    slip.min(pulled_off).min(twisted_out).clamp(start, MOST) / f64::from(STEPS)
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::mechanics::twist_out::TwistOut;
    use crate::model::{Contact, Polygon};

    fn pads() -> Pads {
        let ring = [(-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01)]
            .map(|(x, y)| DVec2::new(x, y))
            .to_vec();
        let patch = vec![Polygon { outer: ring, holes: Vec::new() }];
        Pads::new(&Contact { face_i: patch.clone(), face_ii: patch }).unwrap()
    }

    #[test]
    fn the_force_found_is_the_one_at_which_the_friction_just_holds() {
        let pads = pads();
        for moment in [[0.0, 0.0, 0.2], [0.3, 0.0, 0.2], [0.3, -0.2, 0.05]] {
            let wrench =
                Wrench { force: DVec3::new(3.0, -2.0, 1.0), moment: DVec3::from_array(moment) };
            let force = force_needed(&pads, 0.02, &wrench, 0.4, &Options::default()).unwrap();
            let at = |force: f64| solve_pads(&pads, 0.02, force, &wrench, &Options::default());
            // The last of these twists out before its mu_s comes up to the pads' friction.
            let twists_out = at(force * 0.9998).status == Status::TwistedOut;
            assert!(
                twists_out == (moment[1] != 0.0)
                    && (twists_out || (at(force).mu_s.unwrap() / 0.4 - 1.0).abs() < 1e-8),
                "{moment:?}"
            );
            let held = |score: Score| score.status.holds() && score.mu_s.unwrap() <= 0.4;
            assert!(!held(at(force * 0.9998)) && held(at(force * (1.0 + 1e-9))), "{moment:?}");
            let multiple = load_multiple(&pads, 0.02, 50.0, &wrench, 0.4, &Options::default())
                * if twists_out { 1.0 - 1e-9 } else { 1.0 };
            let grown = Wrench { force: wrench.force * multiple, moment: wrench.moment * multiple };
            let mu = solve_pads(&pads, 0.02, 50.0, &grown, &Options::default()).mu_s.unwrap();
            assert!(
                if twists_out { mu < 0.4 } else { (mu / 0.4 - 1.0).abs() < 1e-8 },
                "{moment:?} {multiple}"
            );
        }
    }

    #[test]
    fn the_limit_is_the_first_on_the_way_up() {
        // Different faces, every kind of load, a friction that many loads reach only with the pads
        // separated: a scan finer than the search's steps finds no load below the limit that is not
        // held.
        let square = |x: f64, a: f64, b: f64| {
            let corner = |i: f64, j: f64| DVec2::new(x + i * a / 2.0, j * b / 2.0);
            vec![Polygon {
                outer: vec![
                    corner(-1.0, -1.0),
                    corner(1.0, -1.0),
                    corner(1.0, 1.0),
                    corner(-1.0, 1.0),
                ],
                holes: Vec::new(),
            }]
        };
        let number = |index: u32, factor: f64| (f64::from(index) * factor).fract() * 2.0 - 1.0;
        let (mut by_slip, mut otherwise, mut falling, mut exact) = (0, 0, 0, 0);
        for index in 1..=60 {
            let contact = Contact {
                face_i: square(0.0, 0.02, 0.01),
                face_ii: square(0.004 * number(index, 0.31), 0.02, 0.012),
            };
            let pads = Pads::new(&contact).unwrap();
            let n = |factor: f64| number(index, factor);
            let force = DVec3::new(n(0.754_877), n(0.569_840), n(0.819_172));
            let wrench = Wrench {
                force,
                moment: DVec3::new(0.05 * n(0.671_043), 0.05 * n(0.549_700), 0.02 * n(0.450_299)),
            };
            let (distance, friction) =
                (0.01 * f64::from(index % 4), 0.2 + 0.4 * f64::from(index % 3));
            let limit = load_multiple(&pads, distance, 1.0, &wrench, friction, &Options::default());
            let at = |multiple: f64| {
                solve_pads(&pads, distance, 1.0 / multiple, &wrench, &Options::default())
            };
            let held = |multiple: f64| {
                let score = at(multiple);
                score.status.holds() && score.mu_s.unwrap() <= friction
            };
            let slips = at(limit * (1.0 + 1e-8)).mu_s.is_some_and(|mu| mu > friction);
            let (sharp, beyond) = if slips { (1e-8, 1e-8) } else { (1e-8, 1.01 * FOUND_LOST) };
            for step in 1..60 {
                let multiple = limit * f64::from(step) / 60.0 * (1.0 - sharp);
                assert!(held(multiple), "{index}: {multiple} of {limit}");
            }
            assert!(!held(limit * (1.0 + beyond)), "{index}: {limit}");
            if slips {
                by_slip += 1
            } else {
                otherwise += 1
            }
            falling +=
                u32::from(at(limit * 0.9).mu_s.unwrap() > at(limit * (1.0 - sharp)).mu_s.unwrap());
            // Without coupling the limit of the contact is known exactly.
            if distance == 0.0 && !slips {
                let grown = |multiple: f64| Wrench {
                    force: wrench.force * multiple,
                    moment: wrench.moment * multiple,
                };
                let (mut low, mut high) = (0.0, 1e3);
                for _ in 0..100 {
                    let middle = (low + high) / 2.0;
                    if TwistOut::new(&contact).margin(1.0, &grown(middle)) > 0.0 {
                        low = middle
                    } else {
                        high = middle
                    }
                }
                assert!(
                    limit <= low * (1.0 + 1e-9) && limit > (1.0 - 2.0 * FOUND_LOST) * low,
                    "{index}: {limit} {low}"
                );
                exact += 1;
            }
        }
        assert!(
            by_slip > 10 && otherwise > 10 && falling > 0 && exact > 2,
            "{by_slip} {otherwise} {falling} {exact}"
        );
    }

    #[test]
    fn a_load_that_twists_out_without_end_needs_no_force_it_could_get() {
        let wrench = Wrench { force: DVec3::ZERO, moment: DVec3::ZERO };
        assert_eq!(force_needed(&pads(), 0.02, &wrench, 0.4, &Options::default()), Some(0.0));
        assert_eq!(force_needed(&pads(), 0.02, &wrench, 0.0, &Options::default()), None);
    }
}
