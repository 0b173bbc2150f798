//! Why there is no grip, in words of the part.

use std::collections::BTreeMap;

use crate::gripper::{self, Gripper, catalogue::CATALOGUE};
use crate::part::{CurvedFace, Part, Shape};
use crate::propose::{ProposeOptions, Tally};

/// Round faces that are spoken of, the largest ones.
const MOST_ROUND: usize = 3;
/// Widths that differ by less are one \[m\].
const SAME_WIDTH: f64 = 1e-5;
/// An arc that covers less has no two sides opposite each other \[rad\].
const HALF_TURN: f64 = 3.1;

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
        } else if options.curved == Some(false) {
            "not tried, as the option curved is off".to_owned()
        } else if turn < HALF_TURN {
            format!("it covers {:.0} deg: no two of its sides are opposite", turn.to_degrees())
        } else {
            let most =
                rejections.iter().max_by_key(|(name, count)| (**count, std::cmp::Reverse(*name)));
            match most {
                Some((reason, count)) => format!(
                    "no pad of {} reaches it; most places, {count}, fall to {}",
                    gripper.name,
                    reason.replace('_', " ")
                ),
                None => format!("no pad of {} reaches it", gripper.name),
            }
        };
        causes.push(format!("{name} (face {}): {why}", face.id));
    }
    causes
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
        Shape::Revolution { .. } => return None,
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
        assert_eq!(mm(0.02054), "20.54 mm");
    }
}
