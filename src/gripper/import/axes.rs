//! The axes of the grip: where a model's pads face, and where its hand reaches.

use glam::{DMat3, DVec3};
use parry3d_f64::transformation::try_convex_hull;

use super::model::Model;
use super::{NONE, PARALLEL, STATES, TILT, bounds};
use crate::error::Result;
use crate::model::Frame;

/// A way that leaves its chord by more than this share of it is no straight one.
const STRAIGHT: f64 = 1e-3;
/// Cosine of the largest angle between the pads' normal and the way that they go.
const FACING: f64 = 0.7;
/// Cosine of the largest angle between an axis of the palm and what is taken to lie along it.
const DRAWN: f64 = 0.8;
/// Normals that differ by less belong to one flat face \[rad\].
const FLAT: f64 = 1e-3;

/// Axes of the grip as columns in the palm link's frame: approach, across, closing; and what they
/// rest on where the model does not say.
pub(super) fn axes(
    model: &Model,
    place: &impl Fn(usize, f64) -> Frame,
    links: [usize; 2],
    points: &[Vec<(String, Vec<DVec3>)>; 2],
) -> Result<(DMat3, Option<String>)> {
    let apart = |t: f64| place(links[0], t).origin - place(links[1], t).origin;
    let way = apart(1.0) - apart(0.0);
    let Some(chord) = Some(way).filter(|way| way.length() > NONE).map(DVec3::normalize) else {
        return Err(model.wrong(
            "the two links do not move towards each other",
            "name the links that touch the part, one of each jaw",
        ));
    };
    let middle = |jaw: usize| {
        let frame = place(links[jaw], 0.5);
        let all = points[jaw].iter().flat_map(|(_, list)| list);
        let [low, high] = bounds(all.map(|&point| frame.point(point)));
        (low + high) / 2.0
    };
    let centres = [middle(0), middle(1)];
    // From jaw II to jaw I.
    let chord = if chord.dot(centres[0] - centres[1]) < 0.0 { -chord } else { chord };
    let straight = (1..STATES).all(|step| {
        let gone = apart(step as f64 / STATES as f64) - apart(0.0);
        gone.reject_from_normalized(chord).length() < STRAIGHT * way.length()
    });
    let faces = [0, 1].map(|jaw: usize| faces(&points[jaw], place(links[jaw], 0.5)));
    let (closing, guess) = closing(chord, straight, &faces);
    let towards = (centres[0] + centres[1]) / 2.0;
    let towards = towards - closing * closing.dot(towards);
    let Some(towards) = Some(towards).filter(|way| way.length() > NONE).map(DVec3::normalize)
    else {
        return Err(model.wrong(
            "the direction of the approach is not to be told: the jaws lie about the palm's origin",
            "describe the gripper by hand: `gripfast gripper new`",
        ));
    };
    // Hands are drawn along an axis of their palm.
    let drawn = along(towards, |axis| axis.dot(closing).abs() < PARALLEL);
    let approach = drawn.unwrap_or(towards);
    let closing = closing.reject_from_normalized(approach).normalize();
    Ok((DMat3::from_cols(approach, closing.cross(approach), closing), guess))
}

/// The palm's axis that is nearest to a direction, if it is near.
fn along(direction: DVec3, may: impl Fn(DVec3) -> bool) -> Option<DVec3> {
    DVec3::AXES
        .into_iter()
        .flat_map(|axis| [axis, -axis])
        .filter(|&axis| may(axis))
        .max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))
        .filter(|axis| axis.dot(direction) > DRAWN)
}

/// The closing direction from the chord of the way that the jaws go and their flat faces. Jaws of
/// two like linkages go along their normal; one on a crank beside a fixed one does not, nor does one
/// on a slanted slide.
fn closing(
    chord: DVec3,
    straight: bool,
    faces: &[Vec<(DVec3, f64)>; 2],
) -> (DVec3, Option<String>) {
    let facing = |jaw: usize, sign: f64| {
        faces[jaw].iter().filter(move |(normal, _)| sign * normal.dot(chord) > FACING)
    };
    let normal = facing(0, -1.0)
        .flat_map(|one| facing(1, 1.0).map(move |other| (one, other)))
        .filter(|((one, _), (other, _))| one.dot(*other) < -TILT.cos())
        .max_by(|a, b| a.0.1.min(a.1.1).total_cmp(&b.0.1.min(b.1.1)))
        .map(|((one, _), (other, _))| (other - one).normalize());
    match normal {
        Some(normal) if !straight || normal.dot(chord) < TILT.cos() => (normal, None),
        _ if straight => (chord, None),
        _ => {
            let axis = along(chord, |_| true);
            let what = if axis.is_some() {
                "the axis of the palm that is nearest to their way"
            } else {
                "the chord of their way"
            };
            let note = format!(
                "the jaws show no flat faces that face each other, and one moves on an arc: they are taken as closing along {what}"
            );
            (axis.unwrap_or(chord), Some(note))
        }
    }
}

/// Outward normals and areas \[m^2\] of the flat faces of the hulls of shapes.
fn faces(shapes: &[(String, Vec<DVec3>)], frame: Frame) -> Vec<(DVec3, f64)> {
    // Sums of the triangles' area vectors.
    let mut found: Vec<DVec3> = Vec::new();
    for (_, list) in shapes {
        let points: Vec<DVec3> = list.iter().map(|&point| frame.point(point)).collect();
        let Ok((corners, triangles)) = try_convex_hull(&points) else { continue };
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        for triangle in triangles {
            let [a, b, c] = triangle.map(|index| corners[index as usize]);
            let area = (b - a).cross(c - a) / 2.0;
            let area = if area.dot(a - middle) < 0.0 { -area } else { area };
            let same = |sum: &&mut DVec3| sum.angle_between(area) < FLAT;
            match found.iter_mut().find(same) {
                Some(sum) => *sum += area,
                None if area.length() > 0.0 => found.push(area),
                None => {}
            }
        }
    }
    found.into_iter().map(|area| (area.normalize(), area.length())).collect()
}
