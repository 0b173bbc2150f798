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
//!
//! What the faces carry without tilt is known at a few normal forces and taken along lines between
//! them. The pressure between two of them lies between theirs everywhere; where both press, it differs
//! from the line's by one number, elsewhere by no more than the compressions do, and both carry the same
//! force: in sum, `int |p - line| dA` is at most twice the rise of the compression times the growth of the
//! area, and that times a lever is what any moment can be off.

use glam::DVec2;
use nalgebra::Vector5;

use super::equilibrium::Problem;
use super::face::{Carried, Face, Pressed};
use super::slip::{self, Bearing, Slipping};
use crate::contact::surface::Field;

/// The faces at a few depths, ready for many loads.
#[derive(Debug)]
pub(super) struct Floors {
    levels: Vec<Level>,
    /// By rising normal force.
    spans: Vec<Span>,
    reach: [Reach; 2],
}

/// Both faces under normal forces from one to another, without tilt.
#[derive(Debug)]
struct Span {
    /// These forces \[N\].
    force: [f64; 2],
    /// What each face carries under the first and the second.
    carried: [[Carried; 2]; 2],
    /// What its friction bears under the first.
    bears: [Bearing; 2],
    /// Most force that lies elsewhere than on the line between both \[N\].
    bent: [f64; 2],
}

/// Farthest place of a face \[m\] and its steepest slope.
#[derive(Debug, Clone, Copy)]
struct Reach {
    place: f64,
    slope: f64,
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
/// Steps of the normal force over which what it carries is no line.
const KNOTS: u32 = 12;
/// Share of a bound that covers what is left of those lines and rounding.
const SLACK: f64 = 1e-6;
/// Difference of slopes that are one, and of directions.
const ALIKE: [f64; 2] = [1e-9, 1e-6];

impl Floors {
    /// For pulls of up to `pull` \[N\] on the pads of a problem under its gripping force `force`, which
    /// alone presses the faces as `squeezed`; `None` where the floors say nothing: two held axes, or one
    /// and pieces that lean differently along the tilt, or a pressure whose middle wanders with the force.
    pub(super) fn new(
        problem: &Problem<'_>,
        squeezed: [&Pressed<'_>; 2],
        force: f64,
        pull: f64,
    ) -> Option<Self> {
        let Problem { faces, held, rolling, .. } = problem;
        let change = 0.5 * pull.max(2.0 * CHANGE * force);
        if change > PULL * force || held.len() > 1 || rolling.iter().any(|x| *x != 0.0) {
            return None;
        }
        let at = |force: f64| {
            let one = faces[0].carry(force, DVec2::ZERO, Some(squeezed[0].delta))?;
            Some([one, faces[1].carry(force, DVec2::ZERO, Some(squeezed[1].delta))?])
        };
        let mut pressed = vec![(force - change, at(force - change)?)];
        let last = at(force + change)?;
        let is_line = |k: usize| {
            let bend =
                0.5 * (pressed[0].1[k].carried() + last[k].carried()) - squeezed[k].carried();
            let reach = faces[k].reach();
            let sizes = [1.0, reach, reach, 1.0, 1.0, reach];
            bend.iter().zip(sizes).all(|(bend, size)| bend.abs() <= LINE * force * size)
        };
        let is_line = is_line(0) && is_line(1);
        if !is_line {
            if !held.is_empty() {
                return None;
            }
            for k in 1..KNOTS {
                let force = force + change * (2.0 * f64::from(k) / f64::from(KNOTS) - 1.0);
                pressed.push((force, at(force)?));
            }
        }
        pressed.push((force + change, last));
        let spans = pressed.iter().zip(&pressed[1..]).map(|((low, from), (high, to))| {
            let bent = |k: usize| if is_line { 0.0 } else { from[k].apart(&to[k]) };
            Span {
                force: [*low, *high],
                carried: [0, 1].map(|k| [from[k].carried(), to[k].carried()]),
                bears: [0, 1].map(|k| Bearing::of(&from[k])),
                bent: [bent(0), bent(1)],
            }
        });
        let spans = spans.collect();
        let levels = match held.first() {
            None => Vec::new(),
            Some(axis) => {
                let along = axis.perp();
                let [one, two] = &pressed[0].1;
                let reach = [faces[0].tilted(along)?, faces[1].tilted(along)?];
                DROPS.iter().filter_map(|drop| level([one, two], along, reach, *drop)).collect()
            }
        };
        let reach = faces.map(|face| Reach { place: face.reach(), slope: face.steepest() });
        Some(Self { levels, spans, reach })
    }

    /// A friction that holds the problem's load for certain, if it is below `value`.
    pub(super) fn below(&self, problem: &Problem<'_>, value: f64) -> Option<f64> {
        let Problem { normal, distance, held, space, .. } = problem;
        let Load { slide, turn, moment, bears, off, .. } = self.load(problem)?;
        let (half, all) = (0.5 * distance, normal[0] + normal[1]);
        // The difference of the faces' forces follows from the spins; along the rest it is as that of the
        // normal forces.
        let mut apart = slide * ((normal[0] - normal[1]) / all);
        for axis in &space.spins {
            let across = axis.perp();
            apart -= (across.dot(apart) + axis.dot(moment) / half) * across;
        }
        let forces = [0.5 * (slide + apart), 0.5 * (slide - apart)];
        let bears = match held.first() {
            None => bears,
            Some(axis) => {
                // Of friction at the value, what is not across the held axis' lever.
                let free = |k: usize| {
                    let across = if space.spins.is_empty() { 0.0 } else { axis.dot(forces[k]) };
                    (value * normal[k]).powi(2) - across * across
                };
                if free(0).min(free(1)) < 0.0 {
                    return None;
                }
                let couple = half.abs() * (free(0).sqrt() + free(1).sqrt());
                let tilts = axis.dot(moment).abs() + couple;
                let level = self.levels.iter().find(|level| tilts <= level.moment)?;
                level.faces.each_ref()
            }
        };
        let [one, two] = bears;
        let left = turn - one.centre.perp_dot(forces[0]) - two.centre.perp_dot(forces[1]);
        let turned = left / (one.turn + two.turn);
        // What the lines leave open of a face's force, and of the turn.
        let force_off = off.force + space.spins.len() as f64 * off.moment / half.abs();
        let levers = one.centre.length() + two.centre.length();
        let turned_off = (off.turn + levers * force_off) / (one.turn + two.turn);
        let asked = |k: usize| {
            bears[k].asks(forces[k], turned) + bears[k].asks_at_most(force_off, turned_off)
        };
        let enough = asked(0).max(asked(1)) * (1.0 + SLACK);
        (enough < value).then_some(enough)
    }

    /// The friction of a body that surely rolls on one face, where nothing can tilt.
    pub(super) fn rolls(&self, problem: &Problem<'_>) -> Option<f64> {
        let Problem { normal, distance, held, space, .. } = problem;
        if !held.is_empty() || space.spins.is_empty() || self.spans.len() > 1 {
            return None;
        }
        let Load { slide, turn, moment, first, bears, .. } = self.load(problem)?;
        let basis = [0, 1].map(|k| space.basis(k, *distance));
        let mut w = Vector5::new(slide.x, slide.y, turn, 0.0, 0.0);
        for (i, axis) in space.spins.iter().enumerate() {
            w[3 + i] = axis.dot(moment);
        }
        (0..2).find_map(|k| {
            let slides = (normal[1 - k], first[1 - k]);
            let Slipping { mu, shares, .. } =
                slip::rolling(&basis, space.spins.len(), k, &w, slides)?;
            (bears[k].bears(&shares[k]) <= mu * (1.0 - SLACK)).then_some(mu)
        })
    }

    /// `None` where the normal forces are beyond those looked at.
    fn load(&self, problem: &Problem<'_>) -> Option<Load<'_>> {
        let Problem { normal, wrench, distance, .. } = problem;
        let span = |k: usize| {
            self.spans.iter().find(|span| normal[k] >= span.force[0] && normal[k] <= span.force[1])
        };
        let spans = [span(0)?, span(1)?];
        let mut off = Off::default();
        let [one, two] = [0, 1].map(|k| {
            let Span { force: [low, high], carried, bent, .. } = spans[k];
            let Reach { place, slope } = self.reach[k];
            off.force += bent[k] * slope;
            off.turn += bent[k] * slope * place;
            off.moment += bent[k] * (place + 0.5 * distance.abs() * slope);
            let [from, to] = &carried[k];
            from.lerp(to, (normal[k] - low) / (high - low))
        });
        let (brought, moment) = problem.brought(&one, &two);
        Some(Load {
            slide: wrench.force.truncate() + DVec2::new(brought.x, brought.y),
            turn: wrench.moment.z + brought.z,
            moment: wrench.moment.truncate() + moment,
            first: [&one, &two].map(|c| DVec2::new(c[1], c[2])),
            bears: [0, 1].map(|k| &spans[k].bears[k]),
            off,
        })
    }
}

/// What friction and tilt have to bear, with what the pressure without tilt brings.
struct Load<'a> {
    /// Force along the pads \[N\].
    slide: DVec2,
    /// Moment about the closing axis, and in the pad plane [N m].
    turn: f64,
    moment: DVec2,
    /// `int p x` of both faces [N m].
    first: [DVec2; 2],
    /// What the friction of both faces bears without tilt under no more than their normal forces.
    bears: [&'a Bearing; 2],
    off: Off,
}

/// By how much a load may be off.
#[derive(Debug, Default)]
struct Off {
    /// In force along the pads \[N\], moment about the closing axis and in the pad plane [N m].
    force: f64,
    turn: f64,
    moment: f64,
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

impl Pressed<'_> {
    /// Most force of a pressure without tilt between this one and `more` that lies elsewhere than on the
    /// line between both \[N\].
    fn apart(&self, more: &Pressed<'_>) -> f64 {
        2.0 * self.face.stiffness * (more.delta - self.delta) * (more.area - self.area)
    }
}

impl Face {
    /// Its steepest slope.
    fn steepest(&self) -> f64 {
        let slopes = self.fields.iter().flat_map(Field::slopes);
        slopes.map(DVec2::length).fold(0.0, f64::max)
    }

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
