//! Questions asked the other way round: how hard to squeeze for a given pad friction, how much load before slip.

use crate::model::{Score, Wrench};

use super::{Options, Pads, solve_pads};

/// The smallest gripping force [N] from which on `friction` holds `wrench`: at it and at every larger force tried,
/// `mu_s <= friction`. `None` when no force up to `1e9` times the load's size does (or `friction` is not positive).
///
/// `mu_s` falls with the force while the contact stays whole, and need not when it separates; so the answer is found from
/// above: from a force that holds downwards to the first that does not, then by bisection to 1e-9 relative.
pub fn force_needed(pads: &Pads, distance: f64, wrench: &Wrench, friction: f64, options: &Options) -> Option<f64> {
    if friction.is_nan() || friction <= 0.0 {
        return None;
    }
    let holds = |force: f64| holds(&solve_pads(pads, distance, force, wrench, options), friction);
    let size = wrench.force.length() + wrench.moment.length() / pads.length;
    if size == 0.0 {
        return Some(0.0);
    }
    // Without coupling or separation mu_s is proportional to 1/force: the first guess is often the answer.
    let mut high = size;
    let mut guess = None;
    if let Some(mu) = solve_pads(pads, distance, 1e3 * size, wrench, options).mu_s {
        guess = (mu > 0.0).then_some(1e3 * size * mu / friction);
    }
    if let Some(force) = guess.filter(|&force| holds(force * (1.0 + 1e-9)) && !holds(force * (1.0 - 1e-9))) {
        return Some(force * (1.0 + 1e-9));
    }
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
