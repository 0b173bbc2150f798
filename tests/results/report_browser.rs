//! The page in a real browser: see `viewer/test/browser.mjs` for what is checked.
//!
//! Needs node, Chromium and the packages of `viewer/` (`npm ci` there); says SKIPPED without them,
//! or fails when the environment variable `GRIPFAST_BROWSER` is `require`. `GRIPFAST_SCREENSHOTS`
//! names a folder for pictures.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::AtomicBool;

use crate::support::report::{data, large, part, plan, refined};
use glam::DVec3;
use gripfast::model::{Miss, Negative};
use gripfast::part::Part;
use gripfast::plan::Plan;
use gripfast::request::{Choice, Polish, Request};
use gripfast::results::{GripSet, RankedGrip};
use gripfast::units::{Angle, Length, Mass};
use gripfast::{export, report};

/// A table, and a vise jaw beside the part.
const SCENE: &str = r#"
[part]
position = ["0mm", "0mm", "100mm"]

[[obstacle]]
name = "table"
plane = [0, 0, 1]
position = ["0mm", "0mm", "90mm"]

[[obstacle]]
name = "vise jaw"
frame = "part"
box = ["60mm", "10mm", "20mm"]
position = ["30mm", "-5mm", "10mm"]
"#;

/// Poses of a set as if they had been rejected: two reasons with places, one without.
fn misses(set: &GripSet) -> Vec<Miss> {
    let reasons = ["part_interference:fingertip", "contact_too_small", "scene:vise_jaw"];
    let miss = |(k, ranked): (usize, &RankedGrip)| {
        let pose = Negative::new(&ranked.grip, reasons[k % 3].to_owned());
        let place = (k % 3 == 0).then_some(ranked.grip.part_from_grip.origin);
        Miss::new(pose, Some(0.002 + 0.001 * k as f64), place)
    };
    set.grips.iter().take(30).enumerate().map(miss).collect()
}

/// A shaft gripped on its barrel, with every load of its grips.
fn curved() -> GripSet {
    let (radius, length, facets) = (0.01, 0.06, 48_u32);
    let ring = |z: f64| {
        (0..facets).map(move |k| {
            let angle = f64::from(k) / f64::from(facets) * std::f64::consts::TAU;
            DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
        })
    };
    let mut vertices: Vec<DVec3> = ring(0.0).chain(ring(length)).collect();
    vertices.extend([DVec3::ZERO, DVec3::new(0.0, 0.0, length)]);
    let triangles: Vec<[u32; 3]> = (0..facets)
        .flat_map(|k| {
            let (next, up) = ((k + 1) % facets, facets);
            let (bottom, top) = (2 * facets, 2 * facets + 1);
            [
                [k, next, k + up],
                [next, next + up, k + up],
                [bottom, next, k],
                [top, k + up, next + up],
            ]
        })
        .collect();
    let part = Part::from_triangles("shaft", &vertices, &triangles).unwrap();
    let mut request = Request::new("shaft.stl", "generic");
    request.mass = Some(Mass(0.2));
    request.loads = vec!["ball:12:20N".to_owned()];
    request.candidates.curved = Some(true);
    request.candidates.spacing = Some(Length(0.01));
    request.candidates.angle_step = Angle(1.6);
    request.scoring.backend = Choice::Cpu;
    request.scoring.polish = Polish::All;
    let plan = Plan::builder(request).part(part).build().unwrap();
    let mut set = plan.run(&mut (), &AtomicBool::new(false)).unwrap().set;
    set.grips.retain(|ranked| ranked.grip.surfaces.is_some());
    assert!(set.grips.len() > 3);
    set
}

#[test]
fn the_page_works_in_a_browser() {
    let viewer = crate::support::root().join("viewer");
    let browser = std::env::var("CHROMIUM").unwrap_or_else(|_| "/usr/bin/chromium".into());
    let missing = if Command::new("node").arg("--version").output().is_err() {
        "node is not installed"
    } else if !Path::new(&browser).exists() {
        "Chromium is not installed (the variable CHROMIUM may name it)"
    } else if !viewer.join("node_modules").is_dir() {
        "viewer/node_modules is not there: run `npm ci` in viewer/"
    } else {
        ""
    };
    if !missing.is_empty() {
        assert_ne!(std::env::var("GRIPFAST_BROWSER").as_deref(), Ok("require"), "{missing}");
        // Past the harness's capture, so that a skip is always seen.
        let _ = writeln!(std::io::stderr(), "SKIPPED: browser test of the report page: {missing}");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let part = part(&data("parts/l_bracket.stl"));
    let mut set = plan(&part, "robotiq-2f85", "ball:60:5N", 0.35, (3, 6), 200);
    let page = |name: &str| folder.path().join(name);
    let fine = refined(&part.mesh, 6);
    let mut many = large(&set, 10_000);
    many.part.triangles = fine.triangles.len();
    report::write(&many, Some(&fine), &[], &page("large.html")).unwrap();
    set.part.file = "</script><img src=x onerror=alert(1)>.stl".into();
    report::write(&set, Some(&part.mesh), &[], &page("small.html")).unwrap();
    // What the page writes is compared with what the program writes.
    let options = export::Options::default();
    export::write(&set, export::Format::Csv, &page("small.csv"), &options, None).unwrap();
    let mut none = set.clone();
    none.grips.clear();
    none.summary.ranked = 0;
    none.summary.rejections = BTreeMap::from([
        ("part_interference:fingertip".into(), 120),
        ("contact_too_small".into(), 30),
        ("scene:vise_jaw".into(), 9),
    ]);
    // With something around the part: a plane and a box that the part's own frame carries.
    std::fs::write(page("scene.toml"), SCENE).unwrap();
    none.provenance.request.candidates.scene = Some(page("scene.toml"));
    report::write(&none, Some(&part.mesh), &misses(&set), &page("none.html")).unwrap();
    report::write(&curved(), None, &[], &page("curved.html")).unwrap();
    let mut slipping = set;
    slipping.provenance.resolved.pad_friction = Some(1e-4);
    for grip in &mut slipping.grips {
        grip.safety = grip.worst.mu_s.map(|mu| 1e-4 / mu);
    }
    slipping.grips.retain(|grip| grip.safety.is_some_and(|safety| safety < 1.0));
    report::write(&slipping, Some(&part.mesh), &[], &page("slipping.html")).unwrap();
    let mut command = Command::new("node");
    command
        .arg(viewer.join("test/browser.mjs"))
        .arg(folder.path())
        .args(std::env::var_os("GRIPFAST_SCREENSHOTS"));
    let output = command.env("CHROMIUM", browser).output().unwrap();
    let text = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .concat();
    println!("{text}");
    assert!(output.status.success(), "{text}");
}
