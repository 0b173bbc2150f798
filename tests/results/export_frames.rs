//! The table of frames on the page about formats is what the exporters write.

use crate::support::grips;
use gripfast::export::{self, Format, Options};
use gripfast::gripper::Gripper;

#[test]
fn the_page_states_the_frame_of_every_format() {
    let page = std::fs::read_to_string(crate::support::root().join("docs/formats.md")).unwrap();
    let table = page
        .split_once("| format | approach | closing | origin | stated in |\n")
        .map(|(_, rest)| rest)
        .unwrap();
    let rows: Vec<Vec<&str>> = table
        .lines()
        .skip(1)
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
        .collect();
    assert_eq!(rows.len(), Format::ALL.len());
    let set = grips::grip_set(1);
    let mut without = set.clone();
    without.gripper["grip_from_flange"] = serde_json::Value::Null;
    for (row, (format, name, _)) in rows.iter().zip(Format::ALL) {
        assert_eq!(row[0], format!("`{name}`"));
        if matches!(format, Format::Json | Format::JsonLines) {
            assert_eq!(row[1..4], ["x1", "x3", "pads (grip frame)"]);
            assert_eq!(export::tool_frame(&set, format, &Options::default()).unwrap(), None);
            continue;
        }
        let place = |origin: &str| match origin {
            "flange" => "at the flange",
            "pads" => "midway between the pads",
            other => panic!("{name}: {other}"),
        };
        let (first, other) = row[3]
            .split_once("; pads where the gripper states no flange")
            .map_or((row[3], row[3]), |(first, _)| (first, "pads"));
        for (set, origin) in [(&set, first), (&without, other)] {
            let expected =
                format!("{} approach, {} closing, origin {}", row[1], row[2], place(origin));
            let found = export::tool_frame(set, format, &Options::default()).unwrap();
            assert_eq!(found.as_deref(), Some(expected.as_str()), "{name}");
        }
        // And in the file, by the name that the page gives.
        let mut bytes = Vec::new();
        if export::check(format).is_err() || matches!(format, Format::Parquet | Format::Intrinsic) {
            continue; // not built in; compressed; without a place for it
        }
        export::write_to(&set, format, &mut bytes, &Options::default(), None).unwrap();
        let frame = format!("{} approach, {} closing", row[1], row[2]);
        let wide: Vec<u8> = frame.bytes().flat_map(|letter| [letter, 0, 0, 0]).collect();
        let holds = |text: &[u8]| bytes.windows(text.len()).any(|window| window == text);
        assert!(holds(frame.as_bytes()) || holds(&wide), "{name}");
    }
}

#[test]
fn moveit_gets_the_flange_beside_a_fixed_jaw() {
    let mut set = grips::grip_set(1);
    let mut gripper: Gripper = serde_json::from_value(set.gripper.clone()).unwrap();
    gripper.moving = gripfast::gripper::Moving::I;
    set.gripper = serde_json::to_value(&gripper).unwrap();
    let grip = &set.grips[0].grip;
    // 100 mm behind the pads, and half the width aside: jaw II has stayed where it was.
    let axes = grip.part_from_grip.rotation;
    let expected = grip.part_from_grip.origin - axes.x_axis * 0.1 - axes.z_axis * grip.width / 2.0;
    let mut bytes = Vec::new();
    export::write_to(&set, Format::MoveIt, &mut bytes, &Options::default(), None).unwrap();
    let text = String::from_utf8(bytes).unwrap();
    let line = text.lines().find(|line| line.contains("position: {")).unwrap();
    let numbers: Vec<f64> =
        line.split(['{', '}', ',', ':']).filter_map(|piece| piece.trim().parse().ok()).collect();
    assert!((glam::DVec3::from_slice(&numbers) - expected).length() < 1e-12, "{line}");
}
