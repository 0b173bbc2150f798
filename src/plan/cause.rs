//! Why there is no grip, in words of the part.

use std::collections::BTreeMap;

use crate::gripper::{self, Gripper, catalogue::CATALOGUE};
use crate::model::Status;
use crate::part::{CurvedFace, Part, Shape};
use crate::propose::{ProposeOptions, Tally};
use crate::rank;
use crate::results::{GripSet, LoadCase};

/// Round faces that are spoken of, the largest ones.
const MOST_ROUND: usize = 3;
/// Widths that differ by less are one \[m\].
const SAME_WIDTH: f64 = 1e-5;
/// An arc that covers less has no two sides opposite each other \[rad\].
const HALF_TURN: f64 = 3.1;

/// Which of the ids asked for are none of the grips found, where all of these are known.
pub(super) fn no_grips(asked: &[u64], set: &GripSet) -> Option<String> {
    if set.grips.len() as u64 != set.summary.ranked {
        return None;
    }
    let found = |id: &u64| {
        set.grips.iter().any(|one| one.grip.id == *id || one.merged.iter().any(|other| other == id))
    };
    let missing: Vec<String> =
        asked.iter().filter(|id| !found(id)).map(ToString::to_string).collect();
    (!missing.is_empty()).then(|| {
        format!(
            "of the ids asked for, no grip is {}: rejected for one of the reasons counted, or not a \
             number of this search (part, gripper and options of the places decide them)",
            missing.join(", ")
        )
    })
}

/// What kept each of the part's opposite and round faces from being gripped, a sentence each.
pub(super) fn causes(
    part: &Part,
    gripper: &Gripper,
    options: &ProposeOptions,
    tally: &Tally,
    rejections: &BTreeMap<String, u64>,
) -> Vec<String> {
    let mut causes = Vec::new();
    let round = || part.curved.iter().filter(|face| face.outside && face.reachable);
    // Round faces speak for themselves.
    let of_round = |width: f64| {
        let mut own = round().filter_map(describe);
        own.any(|(_, across)| (across - width).abs() < SAME_WIDTH)
    };
    let beyond = |&width: &f64| Some((width, within(width, gripper).err()?));
    let mut widths = tally.widths_outside.iter().filter(|width| !of_round(**width));
    if tally.pairs == 0
        && options.outside
        && let Some((width, why)) = widths.find_map(beyond)
    {
        causes.push(format!("{} is {} wide between opposite faces: {why}", part.name, mm(width)));
    }
    for face in round().take(MOST_ROUND).filter(|_| options.outside) {
        let Some((name, across)) = describe(face) else { continue };
        let turn = match face.shape {
            Shape::Cylinder { turn, .. } => turn,
            _ => std::f64::consts::TAU,
        };
        let why = if let Err(why) = within(across, gripper) {
            why
        } else if options.faces.as_ref().is_some_and(|chosen| !chosen.contains(&face.id)) {
            "it is none of the faces chosen".to_owned()
        } else if options.curved == Some(false) {
            "not tried, as the option curved is off".to_owned()
        } else if tally.curved_left_out {
            "not tried beside planes, as curved faces make very many candidates; the option curved \
             tries them"
                .to_owned()
        } else if turn < HALF_TURN {
            format!("it covers {:.0} deg: no two of its sides are opposite", turn.to_degrees())
        } else {
            no_place(gripper, rejections)
        };
        causes.push(format!("{name} (face {}): {why}", face.id));
    }
    causes
}

/// What kept a face whose width the jaws can take from being gripped.
fn no_place(gripper: &Gripper, rejections: &BTreeMap<String, u64>) -> String {
    let none = format!("no pad of {} reaches it", gripper.name);
    // Pairs of faces are rejected for what other faces are.
    let places = rejections.iter().filter(|(name, _)| !name.starts_with("face_pair"));
    let most = places.max_by_key(|(name, count)| (**count, std::cmp::Reverse(*name)));
    let Some((reason, count)) = most else { return none };
    let in_the_way = ["part_interference", "approach", "ground", "keep_out", "scene"];
    let told = reason.replace('_', " ");
    match in_the_way.iter().any(|start| reason.starts_with(start)) {
        true => format!("{none}; most places, {count}, fall to {told}"),
        false => format!("no place on it makes a grip; most of all, {count}, fall to {told}"),
    }
}

/// Where loads lift a pad off with more than the jaws press: the largest load and what they can bear.
pub(super) fn overpowered(
    loads: &[LoadCase],
    force: f64,
    rejections: &BTreeMap<String, u64>,
) -> Option<String> {
    let lost = |status: Status| rejections.get(&rank::status_name(status));
    let count = lost(Status::NoNormalForce)?;
    let most = lost(Status::TwistedOut).max(Some(count))?;
    let size = |load: &&LoadCase| load.wrench.force.length();
    let worst = loads.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    (count == most && size(&worst) > 2.0 * force).then(|| {
        format!(
            "the load '{}' is {:.0} N; along the closing axis jaws that press with {force:.0} N each \
             bear no more than {:.0} N",
            worst.name,
            size(&worst),
            2.0 * force
        )
    })
}

/// What is wrong with a width, and who reaches it.
fn within(width: f64, gripper: &Gripper) -> Result<(), String> {
    let [least, most] = gripper.stroke;
    if (least..=most).contains(&width) {
        return Ok(());
    }
    let others: Vec<&str> = CATALOGUE
        .iter()
        .map(|(name, _)| *name)
        .filter(|name| {
            gripper::find(name).is_ok_and(|other| {
                other.name != gripper.name
                    && *name != "generic"
                    && (other.stroke[0]..=other.stroke[1]).contains(&width)
            })
        })
        .collect();
    let own = if width > most {
        format!("the stroke of {} ends at {}", gripper.name, mm(most))
    } else {
        format!("the jaws of {} close to {} only", gripper.name, mm(least))
    };
    Err(match &others[..] {
        [] => format!("{own}; no gripper of the catalogue reaches it"),
        [one] => format!("{own}; {one} of the catalogue reaches it"),
        several => format!("{own}; {} of the catalogue reach it", several.join(", ")),
    })
}

/// A round face in words, and how far its sides are apart \[m\].
fn describe(face: &CurvedFace) -> Option<(String, f64)> {
    Some(match face.shape {
        Shape::Cylinder { radius, along, .. } => {
            let across = 2.0 * radius;
            (format!("barrel {} x {}", mm(across), mm(along[1] - along[0])), across)
        }
        Shape::Cone { half_angle, along, .. } => {
            let [thin, wide] = along.map(|along| 2.0 * along * half_angle.tan());
            let angle = half_angle.to_degrees();
            (format!("cone of {angle:.2} deg, {} to {}", mm(thin), mm(wide)), thin)
        }
        Shape::Sphere { radius, .. } => (format!("ball of {}", mm(2.0 * radius)), 2.0 * radius),
        Shape::Torus { major, minor, .. } => {
            let across = 2.0 * (major + minor);
            (format!("ring of {}", mm(across)), across)
        }
        Shape::Revolution { .. } | Shape::Freeform => return None,
    })
}

/// A length in millimetres, without zeros at the end.
fn mm(length: f64) -> String {
    format!("{} mm", crate::units::decimal(length * 1e3, 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_is_told_with_those_who_reach_it() {
        let gripper = gripper::find("robotiq-2f85").unwrap();
        assert_eq!(within(0.085, &gripper), Ok(()));
        let told = within(0.1, &gripper).unwrap_err();
        assert_eq!(
            told,
            "the stroke of Robotiq 2F-85 ends at 85 mm; robotiq-2f140, onrobot-rg2, wsg50-110 of \
             the catalogue reach it"
        );
        assert!(
            within(0.5, &gripper).unwrap_err().ends_with("no gripper of the catalogue reaches it")
        );
        assert_eq!(mm(0.02), "20 mm");
    }

    #[test]
    fn a_face_is_out_of_reach_only_where_something_is_in_the_way() {
        let gripper = gripper::find("robotiq-2f85").unwrap();
        let told = |reasons: &[(&str, u64)]| {
            let reasons = reasons.iter().map(|&(name, count)| (name.to_owned(), count));
            no_place(&gripper, &reasons.collect())
        };
        let pair = ("face_pair_outside_stroke", 70);
        assert_eq!(told(&[pair]), "no pad of Robotiq 2F-85 reaches it");
        assert_eq!(
            told(&[pair, ("approach_blocked:finger", 9), ("over_pressure", 8)]),
            "no pad of Robotiq 2F-85 reaches it; most places, 9, fall to approach blocked:finger"
        );
        assert_eq!(
            told(&[pair, ("approach_blocked:finger", 9), ("over_pressure", 10)]),
            "no place on it makes a grip; most of all, 10, fall to over pressure"
        );
    }

    #[test]
    fn a_part_that_is_too_heavy_is_told() {
        let load = |name: &str, force: f64| LoadCase {
            name: name.into(),
            wrench: crate::model::Wrench {
                force: glam::DVec3::new(0.0, 0.6 * force, -0.8 * force),
                moment: glam::DVec3::ZERO,
            },
        };
        let loads = [load("small", 3.0), load("large", 1962.0)];
        let counts = |lost: u64| {
            BTreeMap::from([
                ("part interference:finger".into(), 9000),
                ("twisted_out".into(), 10),
                ("no_normal_force".into(), lost),
            ])
        };
        assert_eq!(
            overpowered(&loads, 150.0, &counts(4000)).unwrap(),
            "the load 'large' is 1962 N; along the closing axis jaws that press with 150 N each bear \
             no more than 300 N"
        );
        assert_eq!(overpowered(&loads, 150.0, &counts(4)), None);
        assert_eq!(overpowered(&loads, 1500.0, &counts(4000)), None);
        assert_eq!(overpowered(&loads, 150.0, &BTreeMap::new()), None);
    }

    #[test]
    fn a_length_has_no_zeros_at_its_end() {
        assert_eq!(mm(0.02), "20 mm");
        assert_eq!(mm(0.02054), "20.54 mm");
    }
}
