//! What every load of a set leaves of the pressure, and how much friction holds a load for certain.
//!
//! A tilt by no more than `A` changes the compression by no more than `A r` where the surface reaches
//! `r` from the middle, and the compression at the pad's plane by no more than that again: nowhere is
//! the pressure less than that of the faces without tilt, pressed by `2 A r` less. The friction that
//! such a pressure can bear grows with it, so that forces which balance a load on this floor do so
//! under the load's own pressure.
//!
//! How far a load tilts: the pads resist by at least the second moment of what the floor presses, and
//! what turns the part is the load's moment and the couple of the two faces' friction, each at most `mu`
//! times its normal force. As long as the friction that the floor asks for at `mu` is below `mu`, the
//! solution, which grows from that without a couple, cannot pass it.

use glam::DVec2;
use nalgebra::Vector5;

use super::equilibrium::Problem;
use super::face::{Carried, Face, Pressed};
use super::slip::{self, Bearing, Slipping};

/// The faces at a few depths, ready for many loads.
#[derive(Debug)]
pub(super) struct Floors {
    levels: Vec<Level>,
    /// Least and greatest normal force \[N\].
    range: [f64; 2],
    /// What each face carries at these without tilt; linear in between.
    carried: [[Carried; 2]; 2],
}

/// The faces pressed by so much less.
#[derive(Debug)]
struct Level {
    faces: [Bearing; 2],
    /// Greatest moment about the held axis under which no load falls below \[N m\].
    moment: f64,
}

/// Shares of the greatest compression by which the levels of a part that can tilt are pressed less.
const DROPS: [f64; 6] = [0.02, 0.05, 0.1, 0.16, 0.23, 0.32];
/// Pull on a pad over the gripping force up to which there are floors.
const PULL: f64 = 0.8;
/// Least change of the normal force, as a share, over which what it carries is looked at.
const CHANGE: f64 = 1e-3;
/// What may be left of a line in the normal force, over it: far below [`SLACK`] of a load.
const LINE: f64 = 1e-12;
/// Share of a bound that covers what is left of those lines and rounding.
const SLACK: f64 = 1e-6;
/// Difference of slopes that are one, and of directions.
const ALIKE: [f64; 2] = [1e-9, 1e-6];

impl Floors {
    /// For pulls of up to `pull` \[N\] on the pads of a problem under its gripping force `force`, which
    /// alone presses the faces as `squeezed`; `None` where the floors say nothing: two held axes, pieces that lean differently along the tilt, or a
    /// pressure whose middle wanders with the force.
    pub(super) fn new(
        problem: &Problem<'_>,
        squeezed: [&Pressed<'_>; 2],
        force: f64,
        pull: f64,
    ) -> Option<Self> {
        let change = 0.5 * pull.max(2.0 * CHANGE * force);
        if change > PULL * force
            || problem.held.len() > 1
            || problem.rolling.iter().any(|x| *x != 0.0)
        {
            return None;
        }
        let range = [force - change, force + change];
        let mut carried = [[Carried::zeros(); 2]; 2];
        let mut least = Vec::new();
        for (k, face) in problem.faces.into_iter().enumerate() {
            let at = |force: f64| face.carry(force, DVec2::ZERO, None);
            let (low, high) = (at(range[0])?, at(range[1])?);
            carried[k] = [&low, &high].map(Pressed::carried);
            let reach = face.reach();
            let bend = 0.5 * (carried[k][0] + carried[k][1]) - squeezed[k].carried();
            let sizes = [1.0, reach, reach, 1.0, 1.0, reach];
            if bend.iter().zip(sizes).any(|(bend, size)| bend.abs() > LINE * force * size) {
                return None;
            }
            least.push(low);
        }
        let [one, two] = &least[..] else { return None };
        let levels = match problem.held.first() {
            None => vec![Level { faces: [one, two].map(Bearing::of), moment: f64::INFINITY }],
            Some(axis) => {
                let along = axis.perp();
                let reach = [problem.faces[0].tilted(along)?, problem.faces[1].tilted(along)?];
                DROPS.iter().filter_map(|drop| level([one, two], along, reach, *drop)).collect()
            }
        };
        Some(Self { levels, range, carried })
    }

    /// A friction that holds the problem's load for certain, if it is below `value`.
    pub(super) fn below(&self, problem: &Problem<'_>, value: f64) -> Option<f64> {
        let Problem { normal, distance, held, space, .. } = problem;
        let Load { slide, turn, moment, .. } = self.load(problem)?;
        let (half, all) = (0.5 * distance, normal[0] + normal[1]);
        // The difference of the faces' forces follows from the spins; along the rest it is as that of the
        // normal forces.
        let mut apart = slide * ((normal[0] - normal[1]) / all);
        for axis in &space.spins {
            let across = axis.perp();
            apart -= (across.dot(apart) + axis.dot(moment) / half) * across;
        }
        let forces = [0.5 * (slide + apart), 0.5 * (slide - apart)];
        // Of friction at the value, what is not across the held axis' lever.
        let free = |k: usize| {
            let known = held.first().filter(|_| !space.spins.is_empty());
            let across = known.map_or(0.0, |axis| axis.dot(forces[k]));
            (value * normal[k]).powi(2) - across * across
        };
        if free(0).min(free(1)) < 0.0 {
            return None;
        }
        let tilts = held.first().map_or(0.0, |axis| {
            axis.dot(moment).abs() + half.abs() * (free(0).sqrt() + free(1).sqrt())
        });
        let level = self.levels.iter().find(|level| tilts <= level.moment)?;
        let [one, two] = &level.faces;
        let left = turn - one.centre.perp_dot(forces[0]) - two.centre.perp_dot(forces[1]);
        let turned = left / (one.turn + two.turn);
        let asked = |k: usize| level.faces[k].asks(forces[k], turned);
        let enough = asked(0).max(asked(1)) * (1.0 + SLACK);
        (enough < value).then_some(enough)
    }

    /// The friction of a body that surely rolls on one face, where nothing can tilt.
    pub(super) fn rolls(&self, problem: &Problem<'_>) -> Option<f64> {
        let Problem { normal, distance, held, space, .. } = problem;
        if !held.is_empty() || space.spins.is_empty() {
            return None;
        }
        let Load { slide, turn, moment, first } = self.load(problem)?;
        let faces = &self.levels.first()?.faces;
        let basis = [0, 1].map(|k| space.basis(k, *distance));
        let mut w = Vector5::new(slide.x, slide.y, turn, 0.0, 0.0);
        for (i, axis) in space.spins.iter().enumerate() {
            w[3 + i] = axis.dot(moment);
        }
        (0..2).find_map(|k| {
            let slides = (normal[1 - k], first[1 - k]);
            let Slipping { mu, shares, .. } =
                slip::rolling(&basis, space.spins.len(), k, &w, slides)?;
            (faces[k].bears(&shares[k]) <= mu * (1.0 - SLACK)).then_some(mu)
        })
    }

    /// `None` where the normal forces are beyond those looked at.
    fn load(&self, problem: &Problem<'_>) -> Option<Load> {
        let Problem { normal, wrench, .. } = problem;
        let [low, high] = self.range;
        if normal.iter().any(|n| *n < low || *n > high) {
            return None;
        }
        let [one, two] = [0, 1].map(|k| {
            let share = (normal[k] - low) / (high - low);
            self.carried[k][0].lerp(&self.carried[k][1], share)
        });
        let (brought, moment) = problem.brought(&one, &two);
        Some(Load {
            slide: wrench.force.truncate() + DVec2::new(brought.x, brought.y),
            turn: wrench.moment.z + brought.z,
            moment: wrench.moment.truncate() + moment,
            first: [&one, &two].map(|c| DVec2::new(c[1], c[2])),
        })
    }
}

/// What friction and tilt have to bear, with what the pressure without tilt brings.
struct Load {
    /// Force along the pads \[N\].
    slide: DVec2,
    /// Moment about the closing axis, and in the pad plane [N m].
    turn: f64,
    moment: DVec2,
    /// `int p x` of both faces [N m].
    first: [DVec2; 2],
}

/// Both faces pressed by the share `drop` of their compression less than `least`, or by a smaller one;
/// `reach`: the greatest change of the compression per tilt along a direction \[m\].
fn level(least: [&Pressed<'_>; 2], along: DVec2, reach: [f64; 2], drop: f64) -> Option<Level> {
    // The tilt that may bring it about.
    let tilt = [0, 1].map(|k| drop * least[k].compression() / (2.0 * reach[k]));
    let tilt = tilt[0].min(tilt[1]);
    let floor = |k: usize| least[k].face.pressed_by(least[k].delta - 2.0 * tilt * reach[k]);
    let floors = [floor(0)?, floor(1)?];
    let stiffness: f64 = floors.iter().map(|floor| along.dot(floor.second_moment() * along)).sum();
    Some(Level { faces: [0, 1].map(|k| Bearing::of(&floors[k])), moment: tilt * stiffness })
}

impl Face {
    /// Greatest change of the compression per tilt along a direction \[m\]; `None` where a piece bends
    /// along it, or where they lean along it by different slopes.
    fn tilted(&self, along: DVec2) -> Option<f64> {
        let mut lean: Option<f64> = None;
        let mut reach: f64 = 0.0;
        for field in &self.fields {
            let slope = along.dot(field.slope(DVec2::ZERO));
            if (field.felt(along) - along).length() > ALIKE[1]
                || (slope - *lean.get_or_insert(slope)).abs() > ALIKE[0]
            {
                return None;
            }
            reach = field.corners().map(|x| along.dot(x).abs()).fold(reach, f64::max);
        }
        (reach > 0.0).then_some(reach)
    }
}
