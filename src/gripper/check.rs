//! What is doubtful about a gripper file that is well formed.

use glam::{DVec2, DVec3};

use super::{Body, Gripper, Jaw};
use crate::geometry::{Bounds2, convex_hull, overlay, patch_area, ring_area};
use crate::model::{Polygon, Ring};

/// Warnings about a gripper, one sentence each; empty when nothing is doubtful.
pub fn check(gripper: &Gripper) -> Vec<String> {
    let mut warnings = Vec::new();
    let mm = |value: f64| format!("{:.2} mm", value * 1e3);
    let alike = gripper.fingers_ii.is_none();
    let jaws = if alike { &Jaw::BOTH[..1] } else { &Jaw::BOTH };
    // Says whose it is where that makes a difference.
    let of = |jaw: Jaw| if alike { String::new() } else { format!(" of jaw {}", jaw.name()) };
    for &jaw in jaws {
        if gripper.bodies(jaw).is_empty() {
            let (of, fingers) = (of(jaw), if alike { "fingers" } else { "that finger" });
            warnings.push(format!(
                "no finger body{of}: {fingers} will not be checked against the part"
            ));
        }
    }
    if gripper.palm.is_empty() {
        warnings.push("no palm body: the palm will not be checked against the part".into());
    }
    let pads = gripper.pads(0.0).map(|pad| Bounds2::of(&pad));
    for &jaw in jaws {
        for body in gripper.bodies(jaw) {
            let low = -body.bounds()[0].z;
            let what = if low <= 1e-9 {
                continue;
            } else if meets_pad(gripper, jaw, body) {
                "it would cut into every part"
            } else if 2.0 * low > gripper.stroke[0] + 1e-9 {
                "the fingers would meet before the jaws have closed"
            } else {
                continue; // beside the pad, and the jaws never come so near
            };
            warnings.push(format!(
                "finger body '{}'{} pokes {} through the pad plane: {what}",
                body.name,
                of(jaw),
                mm(low)
            ));
        }
        let uncovered = uncovered_share(gripper, jaw);
        if !gripper.bodies(jaw).is_empty() && uncovered > 1e-6 {
            warnings.push(format!("the pad{} is larger than the finger behind it: {:.1} % of it has no body within 1 mm", of(jaw), uncovered * 100.0));
        }
    }
    if pads.iter().any(|pad| pad.centre().length() > 0.05 * pad.size().length()) {
        warnings.push("the pad is not centred on the origin: positions are those of the grip origin, not of the pad centre".into());
    }
    let rear = pads[0].min.x.max(pads[1].min.x);
    for body in &gripper.palm {
        let top = body.bounds()[1].x;
        if top > rear {
            warnings.push(format!("palm body '{}' reaches {} past the rear edge of the pads: nothing can be gripped there", body.name, mm(top - rear)));
        }
    }
    if gripper.pad_friction.is_none() {
        warnings.push(
            "pad.friction is not stated: no safety factor and no needed force can be given".into(),
        );
    }
    if gripper.grip_from_flange.is_none() {
        warnings.push("flange is not stated: poses are given for the tool frame only".into());
    }
    let unverified: Vec<&str> = gripper
        .sources
        .iter()
        .filter(|(_, source)| !source.verified)
        .map(|(key, _)| key.as_str())
        .collect();
    if !unverified.is_empty() {
        warnings.push(format!(
            "unverified values (measure them on your gripper): {}",
            unverified.join(", ")
        ));
    }
    warnings
}

/// Free length from the foremost palm face to the rear edge of the pads \[m\]; `None` without a palm.
pub fn throat(gripper: &Gripper) -> Option<f64> {
    let top = gripper.palm.iter().map(|body| body.bounds()[1].x).fold(f64::NEG_INFINITY, f64::max);
    let rear = |pad: &Ring| Bounds2::of(pad).min.x;
    let rear = gripper.pads(0.0).iter().map(rear).fold(f64::NEG_INFINITY, f64::max);
    top.is_finite().then_some(rear - top)
}

/// The pad of a jaw in the grip frame's `(x1, x2)`.
fn pad_of(gripper: &Gripper, jaw: Jaw) -> &Ring {
    match (jaw, &gripper.pad_ii) {
        (Jaw::II, Some(pad)) => pad,
        _ => &gripper.pad,
    }
}

/// Whether a body of a finger lies over a part of its pad.
fn meets_pad(gripper: &Gripper, jaw: Jaw, body: &Body) -> bool {
    let outline = outline(&body.moved(&jaw.at(0.0)), DVec3::X, DVec3::Y);
    let shape = Polygon { outer: outline, holes: Vec::new() };
    let pad = pad_of(gripper, jaw);
    patch_area(&overlay::intersect_convex(pad, &[shape])) > 1e-9 * ring_area(pad)
}

/// Share of a jaw's pad area with no finger body behind it that starts within 1 mm of the pad
/// plane.
fn uncovered_share(gripper: &Gripper, jaw: Jaw) -> f64 {
    let behind = |body: &Body| {
        let outline = outline(body, DVec3::X, DVec3::Y);
        Polygon { outer: outline, holes: Vec::new() }
    };
    let cover = gripper
        .bodies(jaw)
        .iter()
        .filter(|body| body.bounds()[0].z < 1e-3)
        // As they lie: half a turn exchanges the sides of x2.
        .map(|body| body.moved(&jaw.at(0.0)))
        .fold(Vec::new(), |cover, body| overlay::union(&cover, &[behind(&body)]));
    let pad = pad_of(gripper, jaw);
    1.0 - patch_area(&overlay::intersect_convex(pad, &cover)) / ring_area(pad)
}

/// Outline of a body seen along `across x up`, as a convex ring in those two coordinates (round
/// shapes by 256 points).
pub(super) fn outline(body: &Body, across: DVec3, up: DVec3) -> Ring {
    let points: Vec<DVec2> = (0..256)
        .map(|index| {
            // Half a step off the axes, so that a box gives its corners whatever the signs of zero.
            let direction =
                DVec2::from_angle((f64::from(index) + 0.5) * std::f64::consts::TAU / 256.0);
            let point = body.support_point(across * direction.x + up * direction.y);
            DVec2::new(point.dot(across), point.dot(up))
        })
        .collect();
    convex_hull(&points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper::{parse, rectangle};

    const PLAIN: &str = r#"
        name = "t"
        stroke = ["0mm", "50mm"]
        force = ["1N", "2N"]
        pad = { rectangle = ["20mm", "10mm"], friction = 0.5 }
        finger = [{ name = "tip", box = ["20mm", "10mm", "8mm"], at = ["0mm", "0mm", "4mm"] }]
        palm = [{ name = "palm", cylinder = { radius = "40mm", length = "20mm", axis = "x1" }, at = ["-40mm", "0mm", "0mm"] }]
        flange = { origin = ["-50mm", "0mm", "0mm"] }
    "#;

    #[test]
    fn a_sound_gripper_has_no_warning() {
        let gripper = parse(PLAIN, "t").unwrap();
        assert_eq!(check(&gripper), Vec::<String>::new());
        assert!((throat(&gripper).unwrap() - 0.02).abs() < 1e-12);
        assert!(gripper.is_symmetric());
    }

    #[test]
    fn each_doubt_has_its_warning() {
        let mut gripper = parse(PLAIN, "t").unwrap();
        gripper.pad = rectangle(DVec2::new(0.02, 0.02));
        gripper.fingers[0].grip_from_body.origin.z = 0.003;
        gripper.palm[0].grip_from_body.origin.x = 0.0;
        gripper.pad_friction = None;
        gripper.grip_from_flange = None;
        let all = check(&gripper).join("\n");
        for part in [
            "50.0 % of it",
            "pokes 1.00 mm",
            "'palm' reaches 20.00 mm",
            "friction is not stated",
            "flange is not stated",
        ] {
            assert!(all.contains(part), "{part} in {all}");
        }
    }
}
