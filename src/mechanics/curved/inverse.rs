//! How hard to squeeze what is not plane.

use super::Pads;
use super::limit::Limit;
use crate::model::Wrench;

/// Relative width at which the force counts as found.
const FOUND: f64 = 1e-9;
/// The same on the way, so that what is found is right to [`FOUND`].
const CLOSER: f64 = 1e-11;
/// The same where the load is held at no less for want of a limit state: tries there are in vain, and where
/// nothing could be followed each is a search over all tilts.
const HELD: f64 = 1e-7;
/// Solves at most.
const STEPS: i32 = 120;
/// Force over the load's size beyond which none is enough.
const MOST: f64 = 1e9;
/// Slopes of the logarithm of `mu_s` over that of the force that are taken for one.
const SLOPES: std::ops::Range<f64> = -2.0..-0.2;
/// Steps without a bracket after which they grow, each by this factor more: where `mu_s` hardly
/// changes with the force, what is foretold falls short again and again.
const PATIENCE: i32 = 4;
const GROWTH: f64 = 4.0;

/// The gripping force \[N\] at which the pads just hold `wrench` with the friction `friction`, looked
/// for from `start` \[N\] on; `None` where no force holds it. `mu_s` falls with the force: what
/// changes with it beside the loads' share is only how wide the contact is.
///
/// Where the load twists out or pulls a pad off before it slips, the least force at which it does
/// not.
///
/// The limit state is followed from force to force; what is found is then solved by itself.
pub fn force_needed(
    pads: &Pads,
    distance: f64,
    wrench: &Wrench,
    friction: f64,
    start: f64,
) -> Option<f64> {
    let size = wrench.force.length() + wrench.moment.length() / distance.abs().max(1e-6);
    if friction.is_nan() || friction <= 0.0 || start.is_nan() || start <= 0.0 {
        return None;
    }
    // The logarithm of mu_s over the friction; infinite where there is no limit state.
    let over = |mu: Option<f64>| mu.map_or(f64::INFINITY, |mu| (mu / friction).ln());
    let solved = |force: f64| {
        let score = pads.score_first(distance, force, wrench);
        over(score.mu_s.filter(|_| score.status.holds()))
    };
    if size == 0.0 {
        // What leans is pushed out in proportion to the force: any holds it, or none.
        return (solved(start) <= 0.0).then_some(0.0);
    }
    let search = Search { size, most: MOST * size.max(start) };
    let mut near: Option<Limit<'_>> = None;
    let mut next = |force: f64| {
        let limit = pads.limit(distance, force, wrench, near.as_ref());
        let mu = limit.as_ref().and_then(Limit::mu);
        if mu.is_some() {
            near = limit;
        }
        over(mu)
    };
    let end = search.run(start, CLOSER, &mut next);
    if end.is_right(&solved) {
        return end.found;
    }
    search.run(start, FOUND, &mut |force| solved(force)).found
}

/// The search for a force.
struct Search {
    /// The load's size \[N\].
    size: f64,
    /// Force beyond which none is enough \[N\].
    most: f64,
}

/// Where a search ended.
struct End {
    found: Option<f64>,
    /// The greatest force that is too little.
    low: Option<f64>,
}

impl End {
    /// Whether the solution at the force found, or at those tried in vain, agrees.
    fn is_right(&self, solved: &dyn Fn(f64) -> f64) -> bool {
        let Some(found) = self.found else {
            return self.low.is_some_and(|low| solved(low) > 0.0);
        };
        let over = solved(found);
        // Enough, while a little less is not.
        let is_least = || self.low.is_some_and(|low| low < found && solved(low) == f64::INFINITY);
        over.abs() <= FOUND || over.is_finite() && over < 0.0 && is_least()
    }
}

impl Search {
    /// `excess`: the logarithm of `mu_s` over the friction at a force; `within`: as much of it counts
    /// as none.
    fn run(&self, start: f64, within: f64, excess: &mut dyn FnMut(f64) -> f64) -> End {
        // `low` is too little, `high` enough; `last` is the one before, if it has a limit state.
        let mut low: Option<(f64, f64)> = None;
        let mut high: Option<(f64, f64)> = None;
        let mut last: Option<(f64, f64)> = None;
        let mut force = start;
        // Widths of the bracket one and two steps ago, as logarithms.
        let mut widths = [f64::INFINITY; 2];
        let end =
            |found: Option<f64>, low: Option<(f64, f64)>| End { found, low: low.map(|x| x.0) };
        for done in 0..STEPS {
            let here = excess(force);
            if here.abs() <= within {
                return end(Some(force), low);
            }
            if here > 0.0 {
                low = Some((force, here))
            } else {
                high = Some((force, here))
            }
            // mu_s is nearly proportional to one over the force.
            let slope = last
                .map(|(before, value)| (here - value) / (force / before).ln())
                .filter(|slope| SLOPES.contains(slope))
                .unwrap_or(-1.0);
            let foretold = force * (-here / slope).exp();
            last = here.is_finite().then_some((force, here));
            let late = done > PATIENCE;
            let push = if late { 1.0 + FOUND * GROWTH.powi(done - PATIENCE) } else { 1.0 };
            force = match (low, high) {
                (Some((a, over)), Some((b, under))) => {
                    let width = if over.is_finite() { FOUND } else { HELD };
                    if b - a <= width * b {
                        return end(Some(b), low);
                    }
                    let width = (b / a).ln();
                    let slow = width > 0.5 * widths[1];
                    widths = [width, widths[0]];
                    let step = if over.is_finite() { over / (over - under) } else { 0.5 };
                    let step = if step > 0.001 && step < 0.999 && !slow { step } else { 0.5 };
                    let guess = a * (b / a).powf(step);
                    if !slow && foretold.is_finite() && foretold > a && foretold < b {
                        foretold
                    } else {
                        guess
                    }
                }
                (Some((a, over)), None) => {
                    if a > self.most {
                        return end(None, low);
                    }
                    if over.is_finite() {
                        foretold.clamp(push.min(1e3) * a, 1e3 * a)
                    } else {
                        2.0 * a
                    }
                }
                (None, Some((b, under))) => {
                    let least = self.size / MOST;
                    if under == f64::NEG_INFINITY || b < least {
                        return end(Some(b.min(least)), low);
                    }
                    foretold.clamp(1e-3 * b, b / push.min(1e3))
                }
                (None, None) => return end(None, low),
            };
        }
        end(high.map(|(force, _)| force), low)
    }
}
