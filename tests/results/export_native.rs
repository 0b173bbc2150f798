//! The native result file: what is written is read back, and what is broken is refused with its
//! place.

use crate::support::grips;
use glam::DVec3;
use gripfast::request::{Refiner, Separation, Side};
use gripfast::results::{GripSet, Provenance, VERSION};
use gripfast::units::{Force, Length};

fn json(set: &GripSet) -> Vec<u8> {
    let mut bytes = Vec::new();
    set.write_json(&mut bytes).unwrap();
    bytes
}

fn refusal(bytes: &[u8]) -> String {
    GripSet::parse("grips.json", bytes).unwrap_err().to_string()
}

#[test]
fn json_and_json_lines_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for count in [0, 1, 5] {
        let set = grips::grip_set(count);
        let (whole, lines) = (folder.path().join("grips.json"), folder.path().join("grips.jsonl"));
        set.write(&whole).unwrap();
        set.write_lines(&lines).unwrap();
        assert_eq!(GripSet::read(&whole).unwrap(), set);
        assert_eq!(GripSet::read(&lines).unwrap(), set);
        assert_eq!(std::fs::read_to_string(&lines).unwrap().lines().count(), count as usize + 1);
        // Any JSON reader reads it, and one line holds one grip.
        serde_json::from_slice::<serde_json::Value>(&std::fs::read(&whole).unwrap()).unwrap();
        // Whatever layout another program gives it.
        let value = serde_json::to_value(&set).unwrap();
        for text in
            [serde_json::to_string(&value).unwrap(), serde_json::to_string_pretty(&value).unwrap()]
        {
            assert_eq!(GripSet::parse("x", text.as_bytes()).unwrap(), set);
        }
    }
}

/// A set as version 1 wrote it: settings by name.
fn version_1(set: &GripSet) -> serde_json::Value {
    let mut old = serde_json::to_value(set).unwrap();
    old["version"] = 1.into();
    old["provenance"] = serde_json::json!({
        "gripfast": "0.1.0", "command": ["gripfast", "plan", "box.stl"], "backend": "cpu",
        "settings": {
            "angle_step_rad": 0.785, "approach_cone": {"axis": [0.0, 0.0, -1.0], "half_angle_rad": 0.5},
            "clearance_m": 0.001, "closing_friction": 0.1, "complete": false, "faces": [0, 3],
            "faces_in_m": [], "flips": true, "force_n": 80.0,
            "ground": {"height_m": -0.01, "normal": [0.0, 0.0, 1.0]}, "inside": true, "k1": 1.0,
            "k2": 2.0, "keep": 100, "keep_out_m": [[[0.0, 0.0, 0.0], [0.1, 0.2, 0.3]]],
            "max_offset_m": null, "min_contact_share": 0.25, "opening_m": 0.005, "outside": true,
            "pad_friction": null, "polish": "all", "position_error_m": 0.0, "refiner": "shanno",
            "seeds": 81, "separation": "discard", "spacing_m": 0.012
        }
    });
    old
}

#[test]
fn files_of_version_1_are_read_where_they_say_enough() {
    let folder = tempfile::tempdir().unwrap();
    let set = grips::grip_set(3);
    let old = version_1(&set);
    let file = folder.path().join("grips.json");
    std::fs::write(&file, serde_json::to_string_pretty(&old).unwrap()).unwrap();
    let read = GripSet::read(&file).unwrap();
    assert_eq!((&read.grips, &read.loads, read.version), (&set.grips, &set.loads, VERSION));
    let Provenance { request, resolved, complete, .. } = &read.provenance;
    assert!(!complete);
    assert_eq!((resolved.force, resolved.spacing), (Force(80.0), Length(0.012)));
    assert_eq!((resolved.pad_friction, resolved.seeds, resolved.keep), (None, 81, 100));
    let candidates = &request.candidates;
    assert_eq!(candidates.approach.unwrap().half_angle, 0.5);
    assert_eq!(candidates.ground.unwrap().offset, -0.01);
    assert_eq!(candidates.keep_out[0].high, DVec3::new(0.1, 0.2, 0.3));
    assert_eq!((candidates.grips, candidates.flips), (Side::Both, true));
    assert_eq!(
        (candidates.faces.as_deref(), candidates.clearance),
        (Some(&[0, 3][..]), Length(1e-3))
    );
    // What version 1 had no flag for ran with its default.
    assert!(candidates.edge_angles);
    assert_eq!(request.scoring.refiner, Refiner::Shanno);
    assert_eq!(request.scoring.separation, Separation::Discard);

    // JSON Lines too, and on one line.
    let mut head = old.clone();
    head["grips"] = serde_json::json!([]);
    let mut lines = serde_json::to_string(&head).unwrap();
    for grip in old["grips"].as_array().unwrap() {
        lines += "\n";
        lines += &serde_json::to_string(grip).unwrap();
    }
    for text in [lines, serde_json::to_string(&old).unwrap()] {
        assert_eq!(GripSet::parse("x", text.as_bytes()).unwrap(), read);
    }
    // Written again it is of this version.
    read.write(&file).unwrap();
    assert!(std::fs::read_to_string(&file).unwrap().contains("\"version\": 2"));
    assert_eq!(GripSet::read(&file).unwrap(), read);

    // Without the spacing `why` would explain another grid.
    for name in ["spacing_m", "force_n", "outside", "polish"] {
        let mut old = old.clone();
        old["provenance"]["settings"].as_object_mut().unwrap().remove(name);
        let message = refusal(old.to_string().as_bytes());
        assert!(
            message.contains(name) && message.contains("write the file again with `gripfast plan`"),
            "{message}"
        );
    }
}

#[test]
fn infinity_and_nan_are_null_and_readable() {
    let mut set = grips::grip_set(2);
    set.grips[0].score = Some(f64::INFINITY);
    set.grips[0].worst.residual = f64::NAN;
    let text = String::from_utf8(json(&set)).unwrap();
    assert!(!text.contains("inf") && !text.contains("NaN"), "{text}");
    let back = GripSet::parse("x", text.as_bytes()).unwrap();
    assert_eq!(back.grips[0].score, None);
    assert_eq!(back.grips[0].worst.residual, f64::INFINITY);
    assert_eq!(back.grips[1].worst.bounds.unwrap().upper, f64::INFINITY);
}

#[test]
fn a_pose_that_is_not_finite_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("grips.json");
    let mut set = grips::grip_set(2);
    set.grips[1].grip.part_from_grip.origin.y = f64::NAN;
    assert!(set.write(&path).unwrap_err().to_string().contains("grip 8"));
    assert!(!path.exists());
}

#[test]
fn broken_files_are_refused_with_their_place() {
    let good = json(&grips::grip_set(3));
    let text = String::from_utf8(good.clone()).unwrap();
    assert!(refusal(b"").contains("empty"));
    assert!(refusal(b"  \n").contains("empty"));
    assert!(refusal(b"solid part\nfacet normal").contains("grips.json:1"));
    assert!(refusal(b"\xff\x00\xfe").contains("grips.json"));
    assert!(refusal(b"[]").contains("grips.json"));
    assert!(refusal(b"{\"format\": \"other\"}").contains("other"));
    assert!(refusal(b"{}").contains("no format"));
    assert!(
        refusal(text.replace("\"version\": 2", "\"version\": 3").as_bytes())
            .contains("newer gripfast")
    );
    assert!(refusal(text.replace("\"version\": 2", "\"version\": 0").as_bytes()).contains("older"));
    assert!(refusal(text.replace("\"alpha\"", "\"beta\"").as_bytes()).contains("alpha"));
    assert!(
        refusal(text.replace("\"load\":0", "\"load\":7").as_bytes()).contains("load is number 7")
    );
    assert!(refusal(text.replace("\"width\":0.0", "\"width\":-0.0").as_bytes()).contains("width"));
    // Cut off anywhere: an error, never a panic, never half a result.
    for end in (1..good.len() - 3).step_by(97) {
        assert!(GripSet::parse("grips.json", &good[..end]).is_err(), "cut at {end}");
    }
    assert!(refusal(&good[..good.len() - 40]).contains("cut off"));
}

#[test]
fn a_broken_line_is_named() {
    let mut lines = Vec::new();
    grips::grip_set(3).write_json_lines(&mut lines).unwrap();
    let mut text = String::from_utf8(lines).unwrap();
    text.truncate(text.len() - 20);
    assert!(refusal(text.as_bytes()).contains("grips.json:4"));
    let third = text.lines().nth(2).unwrap().to_owned();
    assert!(refusal(text.replace(&third, "{\"rank\": 1}").as_bytes()).contains("grips.json:3"));
}
