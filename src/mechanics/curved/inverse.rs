//! How hard to squeeze what is not plane.

use super::Pads;
use crate::model::Wrench;

/// Relative width at which the force counts as found.
const FOUND: f64 = 1e-9;
/// Solves at most.
const STEPS: u32 = 120;
/// Force over the load's size beyond which none is enough.
const MOST: f64 = 1e9;

/// The gripping force \[N\] at which the pads just hold `wrench` with the friction `friction`, looked
/// for from `start` \[N\] on; `None` where no force holds it. `mu_s` falls with the force: what
/// changes with it beside the loads' share is only how wide the contact is.
///
/// Where the load twists out or pulls a pad off before it slips, the least force at which it does
/// not.
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
    let excess = |force: f64| {
        let score = pads.answer(distance, force, wrench, false).score;
        let mu = score.mu_s.filter(|_| score.status.holds());
        mu.map_or(f64::INFINITY, |mu| (mu / friction).ln())
    };
    if size == 0.0 {
        // What leans is pushed out in proportion to the force: any holds it, or none.
        return (excess(start) <= 0.0).then_some(0.0);
    }
    let most = MOST * size.max(start);
    // `low` is too little, `high` enough.
    let mut low: Option<(f64, f64)> = None;
    let mut high: Option<(f64, f64)> = None;
    let mut force = start;
    for _ in 0..STEPS {
        let here = excess(force);
        if here.abs() <= FOUND {
            return Some(force);
        }
        if here > 0.0 {
            low = Some((force, here))
        } else {
            high = Some((force, here))
        }
        force = match (low, high) {
            (Some((a, over)), Some((b, under))) => {
                if b - a <= FOUND * b {
                    return Some(b);
                }
                // mu_s is nearly proportional to one over the force.
                let step = if over.is_finite() { over / (over - under) } else { 0.5 };
                let step = if step > 0.001 && step < 0.999 { step } else { 0.5 };
                let guess = a * (b / a).powf(step);
                // From the last value, where that falls between.
                let foretold = force * here.exp();
                if foretold.is_finite() && foretold > a && foretold < b { foretold } else { guess }
            }
            (Some((a, over)), None) => {
                if a > most {
                    return None;
                }
                // A little further, so that the answer is soon enclosed.
                a * if over.is_finite() { over.exp().min(1e3) * (1.0 + 1e-7) } else { 2.0 }
            }
            (None, Some((b, under))) => {
                if under == f64::NEG_INFINITY || b < size / MOST {
                    return Some(b.min(size / MOST));
                }
                b * under.exp().max(1e-3) * (1.0 - 1e-7)
            }
            (None, None) => return None,
        };
    }
    high.map(|(force, _)| force)
}
