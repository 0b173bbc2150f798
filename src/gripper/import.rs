//! A gripper file from a robot model (URDF): where its jaws go, and boxes round its links. What a
//! model cannot say is marked as unverified in the file.

mod axes;
mod model;
mod text;

use std::path::Path;

use glam::{DVec2, DVec3};

use crate::error::Result;
use crate::model::Frame;
use axes::axes;
use model::Model;

/// States of the drive that are looked at.
const STATES: usize = 256;
/// Rows of the table of motion.
const ROWS: usize = 17;
/// A way or a turn that is none \[m, rad\].
const NONE: f64 = 1e-6;
/// The pad is what lies this near to the innermost point of a jaw \[m\].
const PAD_DEPTH: f64 = 0.5e-3;
/// A jaw that turns by more while it closes does not stay parallel \[rad\].
const PARALLEL: f64 = 1e-3;
/// By how much it may do so, for what models round \[rad\].
const TILT: f64 = 0.035;

/// A gripper file made from a model.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Imported {
    /// The file.
    pub text: String,
    /// What to look at, a sentence each.
    pub notes: Vec<String>,
}

/// Reads a URDF file and makes a gripper of the two links that touch the part.
///
/// # Errors
/// When the file is no URDF, has no such links, or these do not move towards each other.
pub fn import(path: &Path, jaws: [&str; 2], name: Option<&str>) -> Result<Imported> {
    let model = Model::read(path)?;
    let hand = Hand::new(&model, jaws)?;
    text::write(&model, &hand, name)
}

/// A row of the motion: distance of the pads, advance, and joint.
#[derive(Debug, Clone, Copy)]
struct Row {
    gap: f64,
    advance: f64,
    joint: f64,
}

/// A box in the grip frame of the closed gripper.
#[derive(Debug, Clone, PartialEq)]
struct Block {
    name: String,
    low: DVec3,
    high: DVec3,
    what: &'static str,
}

/// What a model says of a hand.
struct Hand {
    rows: Vec<Row>,
    /// Which of the jaws move.
    moves: [bool; 2],
    /// Sizes of the pads along `x1` and `x2`.
    pads: [DVec2; 2],
    fingers: [Vec<Block>; 2],
    palm: Vec<Block>,
    /// The link that the hand is mounted with, its frame in the grip frame.
    mount: (String, Frame),
    /// Name of the joint that drives the jaws, and its largest effort.
    drive: String,
    effort: f64,
    prismatic: bool,
    /// Whether the motion rests on something that the model does not say.
    doubt: bool,
    notes: Vec<String>,
}

/// Both jaws at one state of the drive, in the axes of the grip.
struct State {
    low: [DVec3; 2],
    high: [DVec3; 2],
}

impl Hand {
    fn new(model: &Model, jaws: [&str; 2]) -> Result<Self> {
        let links = [model.link(jaws[0])?, model.link(jaws[1])?];
        let palm_link = model.common(links)?;
        let drives = model.drives(links, palm_link)?;
        let place = |link: usize, t: f64| {
            let at = model.positions(&drives, t);
            model.place(palm_link, &at).inverse().compose(&model.place(link, &at))
        };
        // The pads are those of the named link; the finger is all that moves with it.
        let pads = links.map(|link| model.rigid(link, true));
        let groups = links.map(|link| model.finger(link, palm_link));
        let points = [0, 1].map(|jaw: usize| model.points(links[jaw], &pads[jaw]));
        let mut notes = model.notes();
        for (jaw, points) in points.iter().enumerate() {
            if points.iter().all(|(_, list)| list.is_empty()) {
                return Err(model.wrong(
                    format!("link '{}' has no shape", jaws[jaw]),
                    "name the links that carry the pads' collision or visual shapes",
                ));
            }
        }
        let turns = turns(model, &place, links, &drives)?;
        let (axes, guess) = axes(model, &place, links, &points)?;
        let known = notes.len();
        notes.extend(guess);
        if turns[0].max(turns[1]) > PARALLEL {
            notes.push(format!(
                "the jaws turn by up to {:.1} deg while they close: their pads are taken as parallel",
                turns[0].max(turns[1]).to_degrees()
            ));
        }
        notes.extend(model.doubts(links, palm_link, &drives));
        let state = |t: f64| -> State {
            let bounds = [0, 1].map(|jaw: usize| {
                let frame = place(links[jaw], t);
                let all = points[jaw].iter().flat_map(|(_, list)| list);
                bounds(all.map(|&point| axes.transpose() * frame.point(point)))
            });
            State { low: bounds.map(|b| b[0]), high: bounds.map(|b| b[1]) }
        };
        let gap = |t: f64| {
            let state = state(t);
            state.low[0].z - state.high[1].z
        };
        let (closed, open) = ends(&gap).ok_or_else(|| {
            model.wrong(
                format!("'{}' and '{}' never stand apart", jaws[0], jaws[1]),
                "name the links that touch the part, one of each jaw",
            )
        })?;
        let here = |jaw: usize, t: f64| axes.transpose() * place(links[jaw], t).origin;
        let way = [0, 1].map(|jaw: usize| here(jaw, open) - here(jaw, closed));
        let moves = way.map(|way| way.z.abs() > NONE);
        if moves == [true; 2] && (way[0].z + way[1].z).abs() > 0.02 * way[0].z.abs() {
            notes.push(
                "the jaws move by different ways: they are taken as moving by the same".to_owned(),
            );
        }
        let doubt = notes.len() > known;
        let middle = |t: f64| {
            let along = [0, 1].map(|jaw: usize| here(jaw, t).x - here(jaw, closed).x);
            match moves {
                [true, false] => along[0],
                [false, true] => along[1],
                _ => f64::midpoint(along[0], along[1]),
            }
        };
        let drive = drives[0];
        let row = |t: f64| Row {
            gap: gap(t),
            advance: middle(t),
            joint: model.positions(&drives, t)[drive],
        };
        let rows = rows(&row, closed, open).ok_or_else(|| {
            model.wrong(
                "the jaws do not open steadily with their joint",
                "describe the gripper by hand: `gripfast gripper new`",
            )
        })?;
        let shut = state(closed);
        let inner = |jaw: usize| -> [DVec3; 2] {
            let frame = place(links[jaw], closed);
            let all: Vec<DVec3> = points[jaw]
                .iter()
                .flat_map(|(_, list)| list)
                .map(|&point| axes.transpose() * frame.point(point))
                .collect();
            let near = |point: &&DVec3| match jaw {
                0 => point.z < shut.low[0].z + PAD_DEPTH,
                _ => point.z > shut.high[1].z - PAD_DEPTH,
            };
            let [low, high] = bounds(all.iter().filter(near).copied());
            if (high - low).truncate().min_element() > 1e-3 {
                [low, high]
            } else {
                bounds(all.iter().copied())
            }
        };
        let outlines = [inner(0), inner(1)];
        let centre = outlines.map(|[low, high]| (low + high) / 2.0);
        // A fixed jaw's pad is where the file's origin lies.
        let height = match moves {
            [true, false] => shut.high[1].z,
            [false, true] => shut.low[0].z,
            _ => f64::midpoint(shut.low[0].z, shut.high[1].z),
        };
        let origin = ((centre[0] + centre[1]) / 2.0).with_z(height);
        let faces = [shut.low[0].z, shut.high[1].z];
        let fingers = [0, 1].map(|jaw: usize| {
            let frame = place(links[jaw], closed);
            let to_grip = |point: &DVec3| {
                (axes.transpose() * frame.point(*point)) - origin.with_z(faces[jaw])
            };
            let whole = model.points(links[jaw], &groups[jaw]);
            blocks(&whole, to_grip, "box round a shape of this link")
        });
        let mut palm = Vec::new();
        let mut fixed = model.rigid(palm_link, false);
        // A fixed jaw is a finger, and not the palm as well.
        fixed.retain(|link| !groups.iter().any(|group| group.contains(link)));
        for (name, list) in model.points(palm_link, &fixed) {
            let to_grip = |point: &DVec3| axes.transpose() * *point - origin;
            palm.extend(blocks(&[(name, list)], to_grip, "box round a shape of this link"));
        }
        let swinging = model.below(palm_link, &fixed, &groups);
        for link in swinging {
            let shapes = model.points(link, &[link]);
            for (name, list) in shapes {
                let all = (0..=32).flat_map(|step| {
                    let t = closed + (open - closed) * f64::from(step) / 32.0;
                    let frame = place(link, t);
                    list.iter()
                        .map(|&point| axes.transpose() * frame.point(point) - origin)
                        .collect::<Vec<_>>()
                });
                let [low, high] = bounds(all);
                if low.is_finite() {
                    let what = "box round all positions of this link";
                    palm.push(Block { name, low, high, what });
                }
            }
        }
        let root = model.top(&fixed);
        let at = model.positions(&drives, closed);
        let mount = model.place(palm_link, &at).inverse().compose(&model.place(root, &at));
        let mount = Frame {
            rotation: axes.transpose() * mount.rotation,
            origin: axes.transpose() * mount.origin - origin,
        };
        Ok(Self {
            rows,
            moves,
            pads: outlines.map(|[low, high]| (high - low).truncate()),
            fingers,
            palm,
            mount: (model.name(root).to_owned(), mount),
            drive: model.joint_name(drive).to_owned(),
            effort: model.effort(drive),
            prismatic: model.is_prismatic(drive),
            doubt,
            notes,
        })
    }
}

/// The angle between two frames \[rad\].
fn turned(from: Frame, to: Frame) -> f64 {
    let turn = from.rotation.transpose() * to.rotation;
    ((turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0) / 2.0).clamp(-1.0, 1.0).acos()
}

/// By how much each jaw turns on its way \[rad\]. A pad that turns is parallel to the other at one
/// width only, and no gripper file says how it stands at the others: refused.
fn turns(
    model: &Model,
    place: &impl Fn(usize, f64) -> Frame,
    links: [usize; 2],
    drives: &[usize],
) -> Result<[f64; 2]> {
    let turns = links.map(|link| {
        let first = place(link, 0.0);
        (1..=STATES)
            .map(|step| turned(first, place(link, step as f64 / STATES as f64)))
            .fold(0.0, f64::max)
    });
    let Some(jaw) =
        (0..2).filter(|&jaw| turns[jaw] > TILT).max_by(|&a, &b| turns[a].total_cmp(&turns[b]))
    else {
        return Ok(turns);
    };
    let joints: Vec<String> =
        drives.iter().map(|&joint| format!("'{}'", model.joint_name(joint))).collect();
    Err(model.wrong(
        format!(
            "'{}' turns by {:.0} deg as joint {} opens the jaws: a jaw whose pad does not stay parallel \
             cannot be described",
            model.name(links[jaw]),
            turns[jaw].to_degrees(),
            joints.join(" and ")
        ),
        "describe the gripper by hand as it stands at the width that you grip, with a stroke of some \
         millimetres about it: `gripfast gripper new`; where a linkage keeps the pad parallel, add its \
         joint to the model as a mimic",
    ))
}

/// The drive with the jaws closed, touching if they do, and open.
fn ends(gap: &impl Fn(f64) -> f64) -> Option<(f64, f64)> {
    let at = |step: usize| step as f64 / STATES as f64;
    let gaps: Vec<f64> = (0..=STATES).map(|step| gap(at(step))).collect();
    let widest = (0..=STATES).max_by(|&a, &b| gaps[a].total_cmp(&gaps[b]))?;
    let least = (0..=STATES).min_by(|&a, &b| gaps[a].total_cmp(&gaps[b]))?;
    if gaps[widest] <= NONE {
        return None;
    }
    let (mut shut, open) = (at(least), at(widest));
    if gaps[least] < 0.0 {
        let mut apart = open;
        for _ in 0..60 {
            let middle = f64::midpoint(shut, apart);
            if gap(middle) < 0.0 { shut = middle } else { apart = middle }
        }
        shut = apart;
    }
    Some((shut, open))
}

/// Rows by rising distance: two where all is straight. `None` where the distance does not rise.
fn rows(row: &impl Fn(f64) -> Row, closed: f64, open: f64) -> Option<Vec<Row>> {
    let rows: Vec<Row> =
        (0..ROWS).map(|k| row(closed + (open - closed) * k as f64 / (ROWS - 1) as f64)).collect();
    if !rows.windows(2).all(|pair| pair[1].gap > pair[0].gap + 1e-9) {
        return None;
    }
    let (first, last) = (rows[0], rows[ROWS - 1]);
    let straight = rows.iter().all(|row| {
        let share = (row.gap - first.gap) / (last.gap - first.gap);
        let off = |value: f64, from: f64, to: f64| (value - from - share * (to - from)).abs();
        off(row.advance, first.advance, last.advance) < NONE
            && off(row.joint, first.joint, last.joint) < 1e-5
    });
    Some(if straight { vec![first, last] } else { rows })
}

fn bounds(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], point| {
        [low.min(point), high.max(point)]
    })
}

/// A box round each shape.
fn blocks(
    shapes: &[(String, Vec<DVec3>)],
    to_grip: impl Fn(&DVec3) -> DVec3,
    what: &'static str,
) -> Vec<Block> {
    shapes
        .iter()
        .map(|(name, list)| {
            let [low, high] = bounds(list.iter().map(&to_grip));
            Block { name: name.clone(), low, high, what }
        })
        .filter(|block| block.low.is_finite())
        .collect()
}

#[cfg(test)]
mod tests;
