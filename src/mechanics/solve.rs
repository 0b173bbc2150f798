//! The answer to one load: the branch from no coupling, the search for further limit states where
//! they may be, and the certificate.

use nalgebra::Vector3;

use super::branch::{self, far_apart, folded, hardly_touching, narrow, strong};
use super::equilibrium::{Solver, State, Vector7};
use super::pads::{Load, Pads};
use super::pressure::{self, face_pressure};
use super::slip;
use super::states::LimitStates;
use crate::contact::{Loops, Twist};
use crate::error::{Error, Result};
use crate::model::{Bounds, Contact, LARGEST_SCALE, Score, Slip, Status, Wrench};
use crate::request::{Refiner, Separation};

/// Whether to look for further solutions where several are possible.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Search {
    /// Where the coupling is strong ([`super::COUPLING_SEARCH`]) or the branch from `d = 0` does not reach
    /// the load: the whole region of contact moments is looked over (`states`).
    #[default]
    WhereNeeded,
    /// Never: only the branch from `d = 0` counts, and a load that it does not reach is refused; no
    /// certificate is made. For comparing many loads or forces before the answer that matters is
    /// solved in full.
    Off,
}

/// Options of [`solve`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Options {
    /// Treatment of separation.
    pub separation: Separation,
    /// Minimiser that polishes the solution.
    pub refiner: Refiner,
    /// A twist about the grip origin to start from (SI, any length), e.g. the best seed.
    pub seed: Option<Twist>,
    /// Whether to look for further solutions.
    pub search: Search,
}

/// Smallest friction coefficient that holds `wrench` (about the grip origin) in a grip with the two
/// contact areas of `contact`, squeezed with `force` \[N\] on each pad on average (equation (9)).
///
/// `distance` \[m\] is the height of face I over face II along `x3`, the `d` of (6)(7): positive for
/// a part between the jaws, negative where the jaws press outwards against the walls of a slot.
/// There face I lies at `x3 = -width/2`, still pushed along `-x3`, and `d = -width`. Reversing `d`
/// and the in-plane load `(F1, F2, M3)` together changes no answer.
///
/// # Errors
/// When a number is not finite or `force` is not positive. A hard case is a [`Status`].
pub fn solve(
    contact: &Contact,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    options: &Options,
) -> Result<Score> {
    check(contact, distance, force, wrench)?;
    Ok(match Pads::new(contact) {
        Some(pads) => solve_pads(&pads, distance, force, wrench, options),
        None => refused(Status::NoContact, 0),
    })
}

/// Every limit state of a load by rising `mu_s`, arguments as [`solve`]: none for a load that
/// [`solve`] refuses, one for most, of which the status is [`Status::Ok`]; several, or one that
/// could not be shown to be the only one, are [`Status::Ambiguous`]. [`solve`] answers with the one
/// on the branch from `d = 0`, where there is one.
///
/// # Errors
/// As [`solve`].
pub fn limit_states(
    contact: &Contact,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    options: &Options,
) -> Result<Vec<Score>> {
    check(contact, distance, force, wrench)?;
    let Some(pads) = Pads::new(contact) else { return Ok(Vec::new()) };
    let load = pads.load(distance, force, wrench);
    if let Some(only) = at_once(&pads, force, &load, options) {
        return Ok(only.mu_s.map(|_| only).into_iter().collect());
    }
    let mut solver = Solver::new(&pads, load, options.refiner);
    let seed = options.seed.map(|twist| pads.scaled_twist(twist));
    let known = solver.branch(seed);
    let found = match load.half_distance {
        // Friction has no lever on the pressure: the branch is all there is.
        0.0 => LimitStates { states: known.into_iter().collect(), complete: true },
        _ => solver.limit_states(known.as_slice()),
    };
    let unique = found.complete && found.states.len() == 1;
    Ok(found
        .states
        .iter()
        .map(|state| finish(&pads, force, &load, state, unique, solver.evaluations, options))
        .collect())
}

pub(crate) fn check(contact: &Contact, distance: f64, force: f64, wrench: &Wrench) -> Result<()> {
    check_numbers(distance, force, wrench)?;
    contact.check("")
}

/// [`check`] without the contact.
pub(super) fn check_numbers(distance: f64, force: f64, wrench: &Wrench) -> Result<()> {
    let bad = |what: &str, value: String, allowed: &str| {
        Err(Error::input(what, format!("is {value}"), format!("give {allowed}")))
    };
    if distance.is_nan() || distance.abs() > LARGEST_SCALE {
        return bad(
            "d",
            distance.to_string(),
            "a distance of at most 1e60 m, negative for a grip from inside",
        );
    }
    if !(force.is_finite() && force > 0.0) {
        return bad("Fn", force.to_string(), "a finite positive force [N]");
    }
    if !wrench.force.is_finite() || !wrench.moment.is_finite() {
        return bad(
            "F, M",
            format!("{:?} {:?}", wrench.force.to_array(), wrench.moment.to_array()),
            "finite numbers",
        );
    }
    Ok(())
}

/// An answer without a limit state.
pub fn refused(status: Status, evaluations: u32) -> Score {
    Score {
        status,
        mu_s: None,
        slip: None,
        pressure: None,
        contact_area_i: 0.0,
        contact_area_ii: 0.0,
        residual: 0.0,
        bounds: None,
        evaluations,
    }
}

/// [`solve`] for a contact already made ready; the numbers must be finite, `force` positive.
pub fn solve_pads(
    pads: &Pads,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    options: &Options,
) -> Score {
    if options.search == Search::Off {
        return solve_next(pads, distance, force, wrench, options, &mut None);
    }
    let load = pads.load(distance, force, wrench);
    if let Some(score) = at_once(pads, force, &load, options) {
        return score;
    }
    let seed = options.seed.map(|twist| pads.scaled_twist(twist));
    let mut solver = Solver::new(pads, load, options.refiner);
    let (state, unique) = match solver.branch(seed) {
        Some(state) if !strong(&state, &load) => {
            let folded = folded(&state, pads, &load);
            if narrow(&state, pads, &load)
                || folded && (hardly_touching(&state, pads) || far_apart(&state, pads, &load))
            {
                let found = solver.limit_states(&[state]);
                match found.states.len() {
                    1 => (state, found.complete),
                    // Newton's method need not have come to the one on the branch.
                    _ => (solver.followed(seed).unwrap_or(state), false),
                }
            } else {
                (state, !folded || solver.partner(&state).is_none())
            }
        }
        None if load.half_distance == 0.0 => {
            return refused(out_of_reach(pads, &load), solver.evaluations);
        }
        branch => {
            let found = solver.limit_states(branch.as_slice());
            match (found.states.as_slice(), found.complete) {
                ([], complete) => {
                    let (grown, evaluations) =
                        branch::by_load(pads, distance, force, wrench, options.refiner);
                    solver.evaluations += evaluations;
                    let none = if complete { Status::TwistedOut } else { Status::NotConverged };
                    let Some(state) = grown else { return refused(none, solver.evaluations) };
                    (state, false)
                }
                ([only], complete) => (*only, complete),
                ([least, ..], _) => (branch.unwrap_or(*least), false),
            }
        }
    };
    finish(pads, force, &load, &state, unique, solver.evaluations, options)
}

/// The answer to a load that needs no slip: without normal force on a pad, or without a part in the
/// pad plane.
fn at_once(pads: &Pads, force: f64, load: &Load, options: &Options) -> Option<Score> {
    if load.normal.iter().any(|&n| n <= 0.0) {
        return Some(refused(Status::NoNormalForce, 0));
    }
    (load.size == 0.0).then(|| pressed_only(pads, force, load, options))
}

/// The limit state of a load, from which that of another one like it is found sooner.
#[derive(Debug, Clone, Copy)]
pub struct Start(pub(super) Vector7);

/// [`solve_pads`] with [`Search::Off`] from the limit state `near` of a load like this one;
/// afterwards `near` is this load's, if it has one.
pub fn solve_next(
    pads: &Pads,
    distance: f64,
    force: f64,
    wrench: &Wrench,
    options: &Options,
    near: &mut Option<Start>,
) -> Score {
    let options = &Options { search: Search::Off, ..*options };
    let load = pads.load(distance, force, wrench);
    if let Some(score) = at_once(pads, force, &load, options) {
        return score;
    }
    let mut solver = Solver::new(pads, load, options.refiner);
    let seed = options.seed.map(|twist| pads.scaled_twist(twist));
    match near.and_then(|Start(z)| solver.next_to(&z)).or_else(|| solver.branch(seed)) {
        Some(state) => {
            *near = Some(Start(state.z));
            finish(pads, force, &load, &state, true, solver.evaluations, options)
        }
        None if load.half_distance == 0.0 => refused(out_of_reach(pads, &load), solver.evaluations),
        None => refused(Status::TwistedOut, solver.evaluations),
    }
}

/// `mu_s` in a limit state that is soon found, from the state `near` of a load like this one or without it,
/// whichever of several it is; `None` where none is. Afterwards `near` is that state.
pub(crate) fn nearby(
    pads: &Pads,
    load: &Load,
    options: &Options,
    near: &mut Option<Start>,
) -> Option<f64> {
    if load.size == 0.0 || load.normal.iter().any(|&n| n <= 0.0) {
        return None;
    }
    let mut solver = Solver::new(pads, *load, options.refiner);
    let seed = options.seed.map(|twist| pads.scaled_twist(twist));
    let state = solver.nearby(near.map(|Start(z)| z).as_ref(), seed)?;
    let parted = |k: usize| pressure::separates(&pads.areas[k], face_pressure(&state.q(), k));
    if options.separation == Separation::Discard && (0..2).any(parted) {
        return None;
    }
    *near = Some(Start(state.z));
    Some(state.mu_over_size * load.size)
}

/// Turns a solved state into an answer with its certificate.
pub(super) fn finish(
    pads: &Pads,
    force: f64,
    load: &Load,
    state: &State,
    unique: bool,
    evaluations: u32,
    options: &Options,
) -> Score {
    let q = state.q();
    let separated = (0..2).any(|k| pressure::separates(&pads.areas[k], face_pressure(&q, k)));
    let rotation =
        |v| slip::friction_wrench(&slip::pressed_fields(pads, &q, &mut Default::default()), v);
    let mu_s = state.mu_over_size * load.size;
    // Answers that are only compared need no certificate.
    let bounds = (options.search != Search::Off)
        .then(|| slip::certificate(load.in_plane(), state.twist(), &state.friction, rotation));
    let r = state.residual;
    let slip_residual = Vector3::new(r[0], r[1], r[2]).amax() * load.size;
    let unit = pads.length * pads.length;
    let status = match (separated, options.separation, unique) {
        (true, Separation::Discard, _) => Status::Separating,
        (_, _, true) => Status::Ok,
        (_, _, false) => Status::Ambiguous,
    };
    Score {
        status,
        // Where the residual leaves more room than the certificate, the certificate knows better.
        mu_s: Some(bounds.map_or(mu_s, |bounds| mu_s.max(bounds.lower).min(bounds.upper))),
        slip: Some(pads.slip(state.twist())),
        pressure: Some(pads.pressure(q, force)),
        contact_area_i: state.moments[0][0] * unit,
        contact_area_ii: state.moments[1][0] * unit,
        residual: slip_residual.max(r.fixed_rows::<4>(3).amax()),
        bounds,
        evaluations,
    }
}

/// Why no pressure was found without friction's help: there is none, or the contact left is too
/// small for doubles (below about 1e-6 of the area).
fn out_of_reach(pads: &Pads, load: &Load) -> Status {
    if pressure::reach(pads, load.normal, load.contact_moment()) > 0.0 {
        Status::NotConverged
    } else {
        Status::TwistedOut
    }
}

/// No load in the pad plane: only the pressure is asked for, and any friction holds.
fn pressed_only(pads: &Pads, force: f64, load: &Load, options: &Options) -> Score {
    let mut scratch = Loops::default();
    let target = load.contact_moment();
    let whole = pressure::solve(pads, load.normal, target, None, &mut scratch);
    let Some(q) =
        whole.or_else(|| pressure::solve_near_rim(pads, load.normal, target, &mut scratch))
    else {
        return refused(out_of_reach(pads, load), 0);
    };
    let m = pressure::pressed_moments(pads, &q, &mut scratch);
    let separated = (0..2).any(|k| pressure::separates(&pads.areas[k], face_pressure(&q, k)));
    let carried = pressure::stiffness(&m) * nalgebra::Vector4::from(q);
    let wanted = nalgebra::Vector4::new(load.normal[0], load.normal[1], target.x, target.y);
    let unit = pads.length * pads.length;
    Score {
        status: if separated && options.separation == Separation::Discard {
            Status::Separating
        } else {
            Status::Ok
        },
        mu_s: Some(0.0),
        slip: Some(Slip::None),
        pressure: Some(pads.pressure(q, force)),
        contact_area_i: m[0][0] * unit,
        contact_area_ii: m[1][0] * unit,
        residual: (carried - wanted).amax(),
        bounds: Some(Bounds { lower: 0.0, upper: 0.0 }),
        evaluations: 0,
    }
}
