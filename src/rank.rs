//! The order of the grips: score, ties, flips, duplicates by symmetry, and a choice of grips that
//! differ.

mod filter;
mod turns;

use std::cmp::Reverse;
use std::collections::BTreeMap;

use glam::DVec3;

use crate::model::{Patch, Status};
use crate::part::Symmetry;
use crate::request::Scoring;
use crate::results::{GripSet, PadFriction, RankedGrip};

pub use filter::Filter;
use turns::Turns;

/// Scores that differ by less than this share count as equal, and other things decide (see [`rank`]):
/// final answers agree to this across backends and refiners, and the order shall not depend on which
/// of them ran.
pub const TIE: f64 = 1e-9;

/// Two lengths \[m\] (or areas, by their square roots) count as equal for
/// [`Options::merge_duplicates`]: part files have coordinates of single precision.
const SAME_LENGTH: f64 = 1e-7;
/// Scores that such lengths can make differ by no more than this share.
const SAME_SCORE: f64 = 1e-5;

/// Weights of the score `k1/mu_s + k2 alpha`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    /// Of `1/mu_s`.
    pub k1: f64,
    /// Of alpha [1/rad].
    pub k2: f64,
}

impl Default for Weights {
    /// `k1 = 1`, `k2 = 1`.
    fn default() -> Self {
        let Scoring { k1, k2, .. } = Scoring::default();
        Self { k1, k2 }
    }
}

impl Weights {
    /// `k1/mu_s + k2 alpha`; infinite for `mu_s = 0` unless `k1 = 0`.
    pub fn score(self, mu_s: f64, alpha: f64) -> f64 {
        // 0/0 where the friction does not count.
        let friction = if self.k1 == 0.0 { 0.0 } else { self.k1 / mu_s };
        friction + self.k2 * alpha
    }
}

/// What [`rank`] keeps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Options {
    /// Weights of the score.
    pub weights: Weights,
    /// What the pads give and what is asked of them: grips that slip come after the others.
    pub pads: PadFriction,
    /// Keeps grips that are another one with the jaws exchanged (`flip_of`).
    pub keep_flips: bool,
    /// Keeps one of the grips that score the same with the same geometry in the grip frame, as
    /// those that a symmetry of the part maps to each other do, and of those that a turn of a round
    /// part maps to each other, whatever they score; [`RankedGrip::merged`] names the others.
    pub merge_duplicates: bool,
    /// Of the part, for this.
    pub symmetry: Option<Symmetry>,
    /// Whether both jaws are alike, for this.
    pub jaws_alike: bool,
    /// Keeps this many.
    pub top: Option<usize>,
    /// With `top`: keeps grips that differ in place, approach and face pair rather than the first
    /// ones.
    pub diverse: bool,
}

setters!(Options {
    with_weights: weights: Weights,
    with_pads: pads: PadFriction,
    with_keep_flips: keep_flips: bool,
    with_merge_duplicates: merge_duplicates: bool,
    with_symmetry: symmetry: Option<Symmetry>,
    with_jaws_alike: jaws_alike: bool,
    with_top: top: Option<usize>,
    with_diverse: diverse: bool,
});

/// The ordered grips and what became of the others.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Ranking {
    /// Best first. `rank` is the place among all grips that were ranked, so a choice by `top` and
    /// `diverse` has gaps.
    pub grips: Vec<RankedGrip>,
    /// Grips that were ranked, before `top`.
    pub ranked: u64,
    /// Of these, those that do not slip.
    pub holding: u64,
    /// Grips left out, by reason: the status (`twisted_out`, ...), `not_finite`, `flip`,
    /// `duplicate`.
    pub rejections: BTreeMap<String, u64>,
}

/// Scores and orders `grips`; their `rank`, `score` and `holds` are set here. `centre_of_mass` and `size`
/// (the diagonal of the bounding box) are the part's \[m\], in the part frame.
///
/// Grips that hold come first, then those that slip, and both in the order of falling score. Among
/// scores within [`TIE`] of each other the grip nearest to the centre of mass comes first, then the
/// one whose contacts are more symmetric about the plane in which the jaws close and more alike, then
/// the one with the larger contacts, then the lower id. The order depends neither on that in which the
/// grips come nor on differences below [`TIE`].
pub fn rank(
    grips: Vec<RankedGrip>,
    centre_of_mass: DVec3,
    size: f64,
    options: &Options,
) -> Ranking {
    let mut ranking = Ranking::default();
    let mut reject = |reason: &str| *ranking.rejections.entry(reason.to_owned()).or_default() += 1;
    let mut kept: Vec<(f64, RankedGrip)> = Vec::with_capacity(grips.len());
    for mut grip in grips {
        if grip.grip.flip_of.is_some() && !options.keep_flips {
            reject("flip");
            continue;
        }
        if !grip.worst.status.holds() {
            reject(&status_name(grip.worst.status));
            continue;
        }
        let score =
            grip.worst.mu_s.map_or(f64::NAN, |mu_s| options.weights.score(mu_s, grip.alpha));
        if score.is_nan() {
            reject("not_finite");
            continue;
        }
        grip.score = score.is_finite().then_some(score);
        grip.holds = options.pads.verdict(grip.friction_needed()).holds();
        kept.push((score, grip));
    }
    order(&mut kept, centre_of_mass);
    if options.merge_duplicates {
        let before = kept.len();
        kept = merge(kept, centre_of_mass, options);
        if kept.len() < before {
            ranking.rejections.insert("duplicate".into(), (before - kept.len()) as u64);
        }
    }
    ranking.ranked = kept.len() as u64;
    ranking.holding = kept.iter().filter(|(_, grip)| !slips(grip)).count() as u64;
    let mut grips: Vec<RankedGrip> = kept.into_iter().map(|(_, grip)| grip).collect();
    for (place, grip) in grips.iter_mut().enumerate() {
        grip.rank = place as u64 + 1;
    }
    if let Some(top) = options.top {
        if options.diverse {
            let chosen = diverse(&grips, top, size);
            let mut place = 0;
            grips.retain(|_| {
                place += 1;
                chosen[place - 1]
            });
        } else {
            grips.truncate(top);
        }
    }
    ranking.grips = grips;
    ranking
}

/// Whether a ranked grip is known to slip.
pub(crate) fn slips(grip: &RankedGrip) -> bool {
    grip.holds == Some(false)
}

/// Far beyond any score.
const FAR: f64 = 1e150;

/// A number that orders grips as [`rank`] does but for ties: it rises with the score, and that of
/// every grip that slips lies below that of every other.
pub fn merit(score: f64, slips: bool) -> f64 {
    match slips {
        false => score,
        true if score >= 0.0 => -FAR / (1.0 + score),
        true => -FAR * (1.0 - score),
    }
}

/// The status as the result file spells it.
pub fn status_name(status: Status) -> String {
    match serde_json::to_value(status) {
        Ok(serde_json::Value::String(name)) => name,
        _ => format!("{status:?}"),
    }
}

/// Whether two scores count as equal, see [`TIE`]. Infinite ones, of grips that need no friction,
/// tie with each other only.
pub(crate) fn ties(a: f64, b: f64) -> bool {
    a == b || ((a - b).is_finite() && (a - b).abs() <= TIE * a.abs().max(b.abs()))
}

/// Those that do not slip first, then falling score, runs of scores that tie by [`preference`].
///
/// A run ends at a gap between neighbours, not at a distance from its first member: two equal grips
/// stay together whatever lies between them.
fn order(grips: &mut [(f64, RankedGrip)], centre_of_mass: DVec3) {
    grips.sort_by(|a, b| {
        let score = b.0.total_cmp(&a.0);
        slips(&a.1).cmp(&slips(&b.1)).then(score).then(a.1.grip.id.cmp(&b.1.grip.id))
    });
    for run in grips.chunk_by_mut(|a, b| slips(&a.1) == slips(&b.1) && ties(a.0, b.0)) {
        run.sort_by_cached_key(|grip| preference(&grip.1, centre_of_mass));
    }
}

/// What is preferred among equal scores, smallest first: distance of the grip from the centre of
/// mass, asymmetry of its contacts, their size (all in steps of [`SAME_LENGTH`]), id.
fn preference(grip: &RankedGrip, centre_of_mass: DVec3) -> (u64, u64, Reverse<u64>, u64) {
    let steps = |length: f64| (length / SAME_LENGTH).round() as u64;
    let contact = &grip.grip.contact;
    let [one, two] =
        [&contact.face_i, &contact.face_ii].map(|patch| crate::geometry::patch_moments(patch));
    let aside = |moments: &crate::geometry::Moments| {
        if moments.area > 0.0 { moments.centroid.y.abs() } else { 0.0 }
    };
    let [one_size, two_size] = [one, two].map(|moments| moments.area.max(0.0).sqrt());
    (
        steps(grip.grip.part_from_grip.origin.distance(centre_of_mass)),
        steps(aside(&one) + aside(&two) + (one_size - two_size).abs()),
        Reverse(steps(one_size + two_size)),
        grip.grip.id,
    )
}

/// What a symmetry of the part, or exchanging the jaws, leaves of a grip: width (negative from
/// inside), the centre of mass in the grip frame up to the signs of `x2` and `x3`, area and second
/// moment of both contacts in either order.
fn geometry(grip: &RankedGrip, centre_of_mass: DVec3) -> [f64; 8] {
    let centre = grip.grip.part_from_grip.point_inverse(centre_of_mass);
    let [mut one, mut two] =
        [&grip.grip.contact.face_i, &grip.grip.contact.face_ii].map(size_and_spread);
    if (one[0], one[1]) < (two[0], two[1]) {
        std::mem::swap(&mut one, &mut two);
    }
    let width = if grip.grip.inside { -grip.grip.width } else { grip.grip.width };
    [width, centre.x, centre.y.abs(), centre.z.abs(), one[0], one[1], two[0], two[1]]
}

/// Root of the area and radius of gyration about the grip axis \[m\].
fn size_and_spread(patch: &Patch) -> [f64; 2] {
    let moments = crate::geometry::patch_moments(patch);
    if moments.area <= 0.0 {
        return [0.0; 2];
    }
    let polar = moments.second.x_axis.x + moments.second.y_axis.y;
    [
        moments.area.sqrt(),
        (polar / moments.area + moments.centroid.length_squared()).max(0.0).sqrt(),
    ]
}

/// Sorts grips in order into families of equal ones.
#[derive(Default)]
struct Families {
    /// Score and shape of the first of each.
    first: Vec<(f64, [f64; 8])>,
    /// The first family whose score is not clearly larger than that of the last grip.
    near: usize,
    /// Whether the last grip slips.
    slipping: bool,
}

impl Families {
    /// The family of the next grip, by its number; a new one has the next number.
    fn take(&mut self, score: f64, grip: &RankedGrip, centre_of_mass: DVec3) -> usize {
        if slips(grip) && !self.slipping {
            // The scores start again.
            (self.near, self.slipping) = (self.first.len(), true);
        }
        let larger = |other: f64| {
            other != score && (other.is_infinite() || other - score > SAME_SCORE * other.abs())
        };
        while self.first.get(self.near).is_some_and(|first| larger(first.0)) {
            self.near += 1;
        }
        let shape = geometry(grip, centre_of_mass);
        let same = |(_, other): &(f64, [f64; 8])| {
            shape.iter().zip(other).all(|(a, b)| (a - b).abs() <= SAME_LENGTH)
        };
        let found = self.first[self.near..].iter().position(same);
        found.map_or_else(
            || {
                self.first.push((score, shape));
                self.first.len() - 1
            },
            |found| self.near + found,
        )
    }
}

/// Sorts grips in order into families of those that a symmetry of the part maps to each other, that
/// exchanging the jaws does, or, whatever they score, a turn about the axis of a round part.
struct Alike {
    centre_of_mass: DVec3,
    equal: Families,
    turns: Option<Turns>,
    /// The family of each family of turns.
    of_turns: Vec<usize>,
}

impl Alike {
    fn new(centre_of_mass: DVec3, symmetry: Option<Symmetry>, jaws_alike: bool) -> Self {
        let turns = symmetry.map(|symmetry| Turns::new(symmetry, jaws_alike));
        Self { centre_of_mass, equal: Families::default(), turns, of_turns: Vec::new() }
    }

    /// The family of the next grip, by its number; a new one has the next number.
    fn take(&mut self, score: f64, grip: &RankedGrip) -> usize {
        let turned = self.turns.as_mut().map(|turns| turns.take(grip));
        let family = match turned.and_then(|turned| self.of_turns.get(turned)) {
            Some(&family) => family,
            None => self.equal.take(score, grip, self.centre_of_mass),
        };
        if turned == Some(self.of_turns.len()) {
            self.of_turns.push(family);
        }
        family
    }
}

/// Keeps the first of each set of equal grips, from grips in order; each one kept names the others.
fn merge(
    grips: Vec<(f64, RankedGrip)>,
    centre_of_mass: DVec3,
    options: &Options,
) -> Vec<(f64, RankedGrip)> {
    let mut kept: Vec<(f64, RankedGrip)> = Vec::with_capacity(grips.len());
    let mut alike = Alike::new(centre_of_mass, options.symmetry, options.jaws_alike);
    for (score, mut grip) in grips {
        if let Some((_, first)) = kept.get_mut(alike.take(score, &grip)) {
            first.merged.push(grip.grip.id);
        } else {
            grip.merged.clear();
            kept.push((score, grip));
        }
    }
    kept
}

/// For each of the ranked grips of a set, best first, the id of the first one that it equals: a
/// symmetry of the part maps them to each other, or exchanging the jaws does. Its own id where it is
/// the first. A turn about the axis of a round part leaves a grip in its family whatever it scores.
pub fn families(set: &GripSet) -> Vec<u64> {
    let symmetry = set.part.symmetry;
    let mut alike =
        Alike::new(set.part.mass.centre_of_mass, symmetry, symmetry.is_some() && jaws_alike(set));
    firsts(&set.grips, |grip| alike.take(grip.score.unwrap_or(f64::INFINITY), grip))
}

/// For each of the ranked grips of a set, best first, the id of the first one that a turn about the
/// axis of the part maps it to; its own where it is the first, or the part is not round.
pub fn turned(set: &GripSet) -> Vec<u64> {
    match set.part.symmetry {
        Some(symmetry) => first_turns(&set.grips, symmetry, jaws_alike(set)),
        None => set.grips.iter().map(|grip| grip.grip.id).collect(),
    }
}

/// As [`turned`], of grips that are not in a set yet.
pub(crate) fn first_turns(grips: &[RankedGrip], symmetry: Symmetry, alike: bool) -> Vec<u64> {
    let mut turns = Turns::new(symmetry, alike);
    firsts(grips, |grip| turns.take(grip))
}

/// The id of the first of each grip's family; families are numbered as they come.
fn firsts(grips: &[RankedGrip], mut family: impl FnMut(&RankedGrip) -> usize) -> Vec<u64> {
    let mut firsts: Vec<u64> = Vec::new();
    let first = |grip: &RankedGrip| {
        let family = family(grip);
        if family == firsts.len() {
            firsts.push(grip.grip.id);
        }
        firsts[family]
    };
    grips.iter().map(first).collect()
}

/// Without a gripper to read nothing is said of exchanging its jaws.
fn jaws_alike(set: &GripSet) -> bool {
    set.read_gripper().is_ok_and(|gripper| gripper.is_symmetric())
}

/// At most `top` of the ranked `grips` that differ in place, approach and face pair, best first.
/// `size`: diagonal of the part's bounding box \[m\].
pub fn choose_diverse(grips: &[RankedGrip], top: usize, size: f64) -> Vec<&RankedGrip> {
    grips
        .iter()
        .zip(diverse(grips, top, size))
        .filter_map(|(grip, chosen)| chosen.then_some(grip))
        .collect()
}

/// Marks `top` grips of an ordered list that differ; those that slip only where the others are not
/// enough.
fn diverse(grips: &[RankedGrip], top: usize, size: f64) -> Vec<bool> {
    let (holding, slipping) = grips.split_at(grips.partition_point(|grip| !slips(grip)));
    let mut chosen = apart(holding, top, size);
    chosen.extend(apart(slipping, top.saturating_sub(holding.len()), size));
    chosen
}

/// Marks `top` grips of an ordered list: each lies at least a distance from every one chosen before
/// it, and the distance is lowered step by step until enough are found.
fn apart(grips: &[RankedGrip], top: usize, size: f64) -> Vec<bool> {
    let mut chosen = vec![false; grips.len()];
    let mut list: Vec<usize> = Vec::new();
    // 0.5: half the part's size, or a right angle of approach. Below 1 % grips are neighbours of a
    // grid, and the rest is filled in order.
    let mut distance = 0.5;
    while list.len() < top.min(grips.len()) {
        for index in 0..grips.len() {
            if list.len() == top {
                break;
            }
            if !chosen[index]
                && list
                    .iter()
                    .all(|other| difference(&grips[index], &grips[*other], size) >= distance)
            {
                chosen[index] = true;
                list.push(index);
            }
        }
        distance = if distance > 0.01 { distance * 0.7 } else { 0.0 };
    }
    chosen
}

/// How much two grips differ: place over the part's size, angle between the approaches over half a
/// turn, and 0.2 for another face pair, as lengths of a right-angled triangle.
fn difference(a: &RankedGrip, b: &RankedGrip, size: f64) -> f64 {
    let place = if size > 0.0 {
        (a.grip.part_from_grip.origin - b.grip.part_from_grip.origin).length() / size
    } else {
        0.0
    };
    let approach =
        a.grip.part_from_grip.rotation.x_axis.angle_between(b.grip.part_from_grip.rotation.x_axis)
            / std::f64::consts::PI;
    let pair = |grip: &RankedGrip| {
        (grip.grip.face_i.min(grip.grip.face_ii), grip.grip.face_i.max(grip.grip.face_ii))
    };
    let faces = if pair(a) == pair(b) { 0.0 } else { 0.2 };
    DVec3::new(place, approach, faces).length()
}
