//! Stored requests: what a run was asked can be asked again, and is what `why` explains.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use gripfast::request::Request;
use gripfast::results::GripSet;

fn gripfast(folder: &Path, line: &str, more: &[&str]) -> Output {
    Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(folder)
        .args(line.split(' ').chain(more.iter().copied()))
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

const OPTIONS: &str = "--gripper generic --mass 100g --backend cpu --spacing 8mm --angle-step 70deg \
                       --edge-angles false --min-pad-share 0.3 --min-opening 1mm \
                       --approach-distance 90mm --approach +z:100deg --keep 40";

fn part() -> String {
    crate::support::root().join("data/parts/t_slot_bar.stl").display().to_string()
}

#[test]
fn a_stored_request_gives_the_same_result_and_flags_override_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (part, read) = (part(), |name: &str| GripSet::read(&at.join(name)).unwrap());
    let first = gripfast(at, &format!("plan {part} {OPTIONS} -q -o first.json"), &[]);
    assert_eq!(first.status.code(), Some(0), "{}", text(&first.stderr));

    let printed = gripfast(at, &format!("plan {part} {OPTIONS} --print-request"), &[]);
    assert_eq!(printed.status.code(), Some(0), "{}", text(&printed.stderr));
    let stored = text(&printed.stdout);
    for line in ["spacing = \"8mm\"", "edge_angles = false", "approach_distance = \"90mm\""] {
        assert!(stored.contains(line), "{line}: {stored}");
    }
    let request = Request::from_toml("stored", &stored).unwrap();
    std::fs::write(at.join("job.toml"), &stored).unwrap();
    std::fs::write(at.join("job.json"), serde_json::to_string(&request).unwrap()).unwrap();
    // The project's defaults are those of command lines; a stored request is whole.
    std::fs::write(at.join("gripfast.toml"), "[plan]\nmass = \"5kg\"\nflips = true\n").unwrap();
    for job in ["job.toml", "job.json"] {
        let again = gripfast(at, &format!("plan --request {job} -q -o again.json"), &[]);
        assert_eq!(again.status.code(), Some(0), "{}", text(&again.stderr));
        assert_eq!(text(&again.stdout), text(&first.stdout));
        assert_eq!(read("again.json").grips, read("first.json").grips);
    }
    let other = gripfast(at, "plan --request=job.toml --density 7850kg/m3 -q -o other.json", &[]);
    assert_eq!(other.status.code(), Some(0), "{}", text(&other.stderr));
    let (first, other) = (read("first.json"), read("other.json"));
    assert_ne!(other.part.mass.mass, first.part.mass.mass);
    assert_eq!(first.provenance.request.candidates, other.provenance.request.candidates);

    // The result carries the request: the same but for where it goes.
    let mut kept = first.provenance.request.clone();
    assert_eq!(kept.output.output.as_deref(), Some(Path::new("first.json")));
    assert!(kept.output.quiet && first.provenance.complete);
    (kept.output.output, kept.output.quiet) = (None, false);
    assert_eq!(kept, request);
    assert_eq!(first.provenance.resolved.keep, 40);
    assert_eq!(first.provenance.command[1], "plan");
}

#[test]
fn why_explains_the_options_that_ran() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let line = format!("plan {} {OPTIONS} -q -o grips.json", part());
    assert_eq!(gripfast(at, &line, &[]).status.code(), Some(0));
    let set = GripSet::read(&at.join("grips.json")).unwrap();
    let id = set.grips[0].grip.id.to_string();
    let told = text(&gripfast(at, "why grips.json", &[&id]).stdout);
    assert!(told.contains("free of interference"), "{told}");
    // With another floor for the contact, set in the request that the result carries, the same grip
    // is no grip.
    let mut strict = set;
    strict.provenance.request.candidates.min_pad_share = 1.0;
    strict.write(&at.join("strict.json")).unwrap();
    let told = text(&gripfast(at, "why strict.json", &[&id]).stdout);
    assert!(told.contains("pad share too small") && told.contains("FAIL"), "{told}");
}

#[test]
fn what_is_no_request_is_refused_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (content, needle) in [
        ("part = \"a.stl\"\n[candidates]\nspacing = 2\n", "job.toml:3"),
        ("part = \"a.stl\"\n[candidates]\nstep = \"2mm\"\n", "step"),
        ("gripper = \"generic\"\nmass = \"1kg\"\n", "part"),
    ] {
        std::fs::write(at.join("job.toml"), content).unwrap();
        let output = gripfast(at, "plan --request job.toml", &[]);
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{err}");
        assert!(err.contains(needle) && err.contains("remedy"), "{needle}: {err}");
    }
    let output = gripfast(at, "plan --request nowhere.toml", &[]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("nowhere.toml"));
    let output = gripfast(at, "plan --gripper generic", &[]);
    assert!(output.status.code() == Some(2) && text(&output.stderr).contains("PART"));
}

#[test]
fn warnings_are_printed_and_kept_though_it_is_quiet() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bytes = std::fs::read(crate::support::root().join("data/parts/hex_nut.stl")).unwrap();
    // A binary file without its last triangle has a hole.
    let count = u32::from_le_bytes(bytes[80..84].try_into().unwrap()) - 1;
    let mut open = bytes[..bytes.len() - 50].to_vec();
    open[80..84].copy_from_slice(&count.to_le_bytes());
    std::fs::write(at.join("open.stl"), open).unwrap();
    let line = "plan open.stl --gripper generic --mass 20g --backend cpu --spacing 8mm \
                --angle-step 90deg -q -o grips.json";
    let output = gripfast(at, line, &[]);
    let err = text(&output.stderr);
    assert!(err.contains("warning: ") && err.contains("not watertight"), "{err}");
    assert!(!err.contains("backend"), "notes are not: {err}");
    let set = GripSet::read(&at.join("grips.json")).unwrap();
    assert!(set.provenance.warnings.iter().any(|warning| warning.contains("not watertight")));
}
