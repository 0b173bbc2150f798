//! The native result file: what is written is read back, and what is broken is refused with its
//! place.

use crate::support::grips;
use gripfast::results::GripSet;

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
        refusal(text.replace("\"version\": 1", "\"version\": 2").as_bytes())
            .contains("newer gripfast")
    );
    assert!(refusal(text.replace("\"version\": 1", "\"version\": 0").as_bytes()).contains("older"));
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
