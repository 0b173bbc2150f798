//! The page as text: complete, self-contained, harmless, and its template built from the sources in
//! `viewer/`.

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::path::PathBuf;
use std::process::Command;

use crate::support;
use crate::support::report::{data, part};
use assert_cmd::cargo::cargo_bin_cmd;
use base64::Engine;
use flate2::read::GzDecoder;
use glam::DVec3;
use gripfast::error::ErrorKind;
use gripfast::load::wrench_in_grip;
use gripfast::model::Polygon;
use gripfast::part::Mesh;
use gripfast::report::{self, TEMPLATE};
use gripfast::results::GripSet;
use serde_json::Value;

fn fixture() -> (GripSet, Mesh) {
    let part = part(&data("parts/l_bracket.stl"));
    (support::report::plan(&part, "robotiq-2f85", "ball:12:5N", 0.35, (2, 3), 40), part.mesh)
}

fn viewer() -> PathBuf {
    crate::support::root().join("viewer")
}

/// What `viewer/build.mjs` calls the fingerprint: 64-bit FNV-1a of names and contents.
fn fingerprint() -> String {
    let mut names: BTreeSet<String> =
        ["build.mjs", "package.json", "package-lock.json"].map(String::from).into();
    names.extend(
        std::fs::read_dir(viewer().join("src"))
            .unwrap()
            .map(|entry| format!("src/{}", entry.unwrap().file_name().into_string().unwrap())),
    );
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut eat = |bytes: &[u8]| {
        bytes
            .iter()
            .chain(&[0])
            .for_each(|byte| hash = (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3))
    };
    for name in names {
        eat(name.as_bytes());
        eat(&std::fs::read(viewer().join(&name)).unwrap());
    }
    format!("{hash:016x}")
}

/// The text between two marks.
fn between<'a>(text: &'a str, before: &str, after: &str) -> &'a str {
    text.split_once(before).unwrap().1.split_once(after).unwrap().0
}

fn header(page: &str) -> Value {
    serde_json::from_str(between(page, r#"id="report-header">"#, "</script>")).unwrap()
}

/// A column of single-precision numbers.
fn column(page: &str, name: &str) -> Vec<f32> {
    cells(page, name, "f32").into_iter().map(f32::from_le_bytes).collect()
}

/// A column of whole numbers.
fn numbers(page: &str, name: &str) -> Vec<u32> {
    cells(page, name, "u32").into_iter().map(u32::from_le_bytes).collect()
}

/// The cells of a column of this kind, four bytes each.
fn cells(page: &str, name: &str, kind: &str) -> Vec<[u8; 4]> {
    let packed = base64::engine::general_purpose::STANDARD
        .decode(between(page, r#"id="report-data">"#, "</script>"))
        .unwrap();
    let mut bytes = Vec::new();
    GzDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
    let section = &header(page)["sections"][name];
    assert_eq!(section[0], kind);
    let [offset, count] = [1, 2].map(|k| section[k].as_u64().unwrap() as usize);
    bytes[offset..offset + 4 * count]
        .chunks_exact(4)
        .map(|bytes| bytes.try_into().unwrap())
        .collect()
}

#[test]
fn the_template_was_built_from_these_sources() {
    let recorded = between(TEMPLATE, r#"name="gripfast-viewer-sources" content=""#, "\"");
    assert_eq!(
        recorded,
        fingerprint(),
        "viewer/ has changed: run `npm ci && npm run build` there and commit src/report/page.html"
    );
}

#[test]
fn a_rebuild_gives_the_same_template() {
    let missing = if viewer().join("node_modules").is_dir() {
        ""
    } else {
        "viewer/node_modules is not there: run `npm ci` in viewer/"
    };
    if !missing.is_empty() {
        assert_ne!(std::env::var("GRIPFAST_BROWSER").as_deref(), Ok("require"), "{missing}");
        let _ = writeln!(std::io::stderr(), "SKIPPED: rebuild of the report page: {missing}");
        return;
    }
    let output =
        Command::new("node").arg(viewer().join("build.mjs")).arg("--check").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_page_is_whole_and_loads_nothing() {
    let (set, mesh) = fixture();
    let page = report::render(&set, Some(&mesh), &[]).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    assert!(!page.contains("@@"), "a mark was left");
    assert_eq!(page.matches("<script").count(), page.matches("</script").count());
    assert_eq!(page.matches("</script").count(), 3);
    assert!(
        page.contains("default-src 'none'"),
        "the content security policy forbids every request"
    );
    // Addresses occur in comments and in namespace names, never where a browser would load from
    // them.
    for loads in
        ["src=\"http", "href=\"http", "src=\"//", "url(http", "@import", "<link rel=\"stylesheet"]
    {
        assert!(!page.contains(loads), "{loads}");
    }
    assert!(
        page.contains("Permission is hereby granted, free of charge")
            && page.contains("three.js authors"),
        "three.js's licence"
    );
}

#[test]
fn the_page_carries_the_numbers() {
    let (set, mesh) = fixture();
    let page = report::render(&set, Some(&mesh), &[]).unwrap();
    let header = header(&page);
    assert_eq!(header["grips"]["total"], set.grips.len());
    assert_eq!(header["display"]["shown"], mesh.triangles.len());
    assert_eq!(header["loads"].as_array().unwrap().len(), set.loads.len());
    let mu: Vec<f32> =
        set.grips.iter().map(|grip| grip.worst.mu_s.map_or(f32::NAN, |mu| mu as f32)).collect();
    assert_eq!(
        column(&page, "mu").iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
        mu.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    );
    let rotation = column(&page, "rotation");
    let x3 = DVec3::from_array([6, 7, 8].map(|k| f64::from(rotation[k])));
    assert!(
        (x3 - set.grips[0].grip.part_from_grip.rotation.z_axis).length() < 1e-6,
        "the third column is the closing axis"
    );
    let areas = |points: &[f32]| points.len();
    assert!(areas(&column(&page, "points")) >= 16);
}

#[test]
fn names_from_files_stay_data() {
    let (mut set, _) = fixture();
    set.part.file = "</script><script>alert(1)</script>".into();
    set.loads[0].name = "<!--<script>".into();
    let page = report::render(&set, None, &[]).unwrap();
    assert_eq!(page.matches("</script").count(), 3);
    assert_eq!(header(&page)["part"]["file"], set.part.file);
    assert_eq!(header(&page)["loads"][0]["name"], set.loads[0].name);
}

#[test]
fn poor_results_still_make_a_page() {
    let (mut set, _) = fixture();
    set.gripper = Value::String("lost".into());
    let page = report::render(&set, None, &[]).unwrap();
    assert!(
        header(&page)["gripper"].is_null()
            && header(&page)["gripper_problem"].is_string()
            && header(&page)["display"].is_null()
    );
    set.grips.iter_mut().for_each(|grip| grip.mu_by_load.clear());
    assert_eq!(
        header(&report::render(&set, Some(&Mesh::default()), &[]).unwrap())["by_load"]["rows"],
        0
    );
    set.grips.clear();
    assert_eq!(header(&report::render(&set, None, &[]).unwrap())["grips"]["total"], 0);
}

/// A page of `plan`, or one made of its result file later, has all loads of the best grips and of
/// those printed; nothing else in the file depends on the page.
#[test]
fn the_best_grips_have_every_load() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let output =
            cargo_bin_cmd!("gripfast").current_dir(folder.path()).args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let bracket = data("parts/l_bracket.stl").display().to_string();
    let plan = [
        "plan",
        &bracket,
        "--gripper",
        "robotiq-2f85",
        "--mass",
        "350g",
        "--loads",
        "ball:40",
        "--spacing",
        "12mm",
        "--angle-step",
        "45deg",
        "--diverse",
    ];
    run(&[&plan[..], &["-o", "paged.json", "--report", "paged.html"]].concat());
    run(&[&plan[..], &["-o", "bare.json"]].concat());
    run(&["report", "bare.json", "-o", "later.html"]);
    let [mut paged, bare] =
        ["paged.json", "bare.json"].map(|name| GripSet::read(&folder.path().join(name)).unwrap());
    assert!(paged.grips.len() > 40 && bare.grips.iter().all(|grip| grip.mu_by_load.is_empty()));
    let whole: Vec<usize> =
        (0..paged.grips.len()).filter(|&place| !paged.grips[place].mu_by_load.is_empty()).collect();
    assert!(
        whole[..20].iter().copied().eq(0..20) && whole.len() > 20 && whole.len() <= 40,
        "the best ones and those that differ: {whole:?}"
    );
    for grip in paged.grips.iter().filter(|grip| !grip.mu_by_load.is_empty()) {
        let mu = grip.worst.mu_s.unwrap();
        let most = grip.mu_by_load.iter().flatten().fold(0.0_f64, |most, mu| most.max(*mu));
        assert!(
            grip.mu_by_load.len() == 40 && (most - mu).abs() <= 1e-9 * mu,
            "grip {}: {most}, {mu}",
            grip.grip.id
        );
        assert!((grip.mu_by_load[grip.worst.load as usize].unwrap() - mu).abs() <= 1e-9 * mu);
    }
    let [page, later] = ["paged.html", "later.html"]
        .map(|name| std::fs::read_to_string(folder.path().join(name)).unwrap());
    assert_eq!(
        (&header(&page)["by_load"]["rows"], &header(&later)["by_load"]["rows"]),
        (&Value::from(whole.len()), &Value::from(20))
    );
    paged.grips.iter_mut().for_each(|grip| grip.mu_by_load.clear());
    assert_eq!(paged.grips, bare.grips);
}

/// The pressure that the page has for a load carries that load: its integral over a pad is the
/// normal force, and its moments differ by the load's moment and the friction's, which acts in the
/// pad planes.
#[test]
fn every_state_of_the_page_carries_its_load() {
    let (set, mesh) = fixture();
    let page = report::render(&set, Some(&mesh), &[]).unwrap();
    let [rows, loads] = ["state_rows", "state_load"].map(|name| numbers(&page, name));
    let (pressure, slip) = (column(&page, "state_pressure"), column(&page, "state_slip"));
    let ends: Vec<u32> = (0..=set.grips.len() as u32).map(|row| row * 12).collect();
    assert_eq!(rows, ends, "the fixture has all twelve loads of all grips");
    let force = set.provenance.resolved.force.0;
    let mut whole = 0;
    for (row, ranked) in set.grips.iter().enumerate() {
        let range = rows[row] as usize..rows[row + 1] as usize;
        let own = &loads[range.clone()];
        let mu = |load: u32| ranked.mu_by_load[load as usize].unwrap_or(f64::INFINITY);
        assert!(own.windows(2).all(|pair| mu(pair[0]) >= mu(pair[1])), "hardest first");
        for (state, &load) in range.zip(own) {
            let [a_i, a_ii, a1, a2] = [0, 1, 2, 3].map(|k| f64::from(pressure[4 * state + k]));
            assert!((1.0..=3.0).contains(&slip[7 * state]), "planes do not spin");
            let wrench = wrench_in_grip(
                &set.loads[load as usize].wrench,
                set.part.mass.centre_of_mass,
                &ranked.grip.part_from_grip,
            );
            let contact = &ranked.grip.contact;
            let faces = [(&contact.face_i, a_i, 1.0), (&contact.face_ii, a_ii, -1.0)];
            for (patch, at_origin, sign) in faces {
                let corners = || patch.iter().flat_map(|polygon| &polygon.outer);
                let value = |x: f64, y: f64| at_origin + sign * (a1 * x + a2 * y);
                if corners().any(|point| value(point.x, point.y) < 0.0) {
                    continue;
                }
                // A plane integrates to its value at the centroid times the area.
                let [area, sx, sy] = patch
                    .iter()
                    .map(area_moments)
                    .fold([0.0; 3], |sum, one| [sum[0] + one[0], sum[1] + one[1], sum[2] + one[2]]);
                let carried = area * value(sx / area, sy / area);
                let normal = force + sign * wrench.force.z / 2.0;
                assert!((carried / normal - 1.0).abs() < 1e-5, "{carried} {normal}");
                whole += 1;
            }
        }
    }
    assert!(whole > 20, "{whole}");
}

/// Area and first moments of a polygon with holes.
fn area_moments(polygon: &Polygon) -> [f64; 3] {
    let ring = |ring: &[glam::DVec2]| {
        ring.iter().zip(ring.iter().cycle().skip(1)).fold([0.0; 3], |[a, x, y], (p, q)| {
            let cross = p.perp_dot(*q) / 2.0;
            [a + cross, x + cross * (p.x + q.x) / 3.0, y + cross * (p.y + q.y) / 3.0]
        })
    };
    let positive = |[a, x, y]: [f64; 3]| [a.abs(), x * a.signum(), y * a.signum()];
    let outer = positive(ring(&polygon.outer));
    polygon.holes.iter().fold(outer, |sum, hole| {
        let hole = positive(ring(hole));
        [sum[0] - hole[0], sum[1] - hole[1], sum[2] - hole[2]]
    })
}

/// Nothing found is an answer to look at: exit code 1, and a page that says why.
#[test]
fn a_plan_without_grips_writes_its_page() {
    let folder = tempfile::tempdir().unwrap();
    let output = cargo_bin_cmd!("gripfast")
        .current_dir(folder.path())
        .arg("plan")
        .arg(data("parts/l_bracket.stl"))
        .args(["--gripper", "robotiq-2f85", "--mass", "350g", "--ground", "+z:100mm"])
        .args(["--spacing", "12mm", "--angle-step", "45deg", "--report", "none.html"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(folder.path().join("none.html")).unwrap();
    let header = header(&page);
    assert_eq!(header["grips"]["total"], 0);
    assert!(header["summary"]["rejections"]["ground:fingertip"].as_u64() > Some(0));
    assert!(
        header["asked"]["ground"]["height_m"] == 0.1 && header["asked"]["force"].as_f64().is_some(),
        "what was asked for travels with the page: {}",
        header["asked"]
    );
    assert_eq!(header["gripper"]["flange"].as_array().map(Vec::len), Some(16));
    // What fell is there to look at, each with what it lacks.
    let reasons: Vec<&str> =
        header["reasons"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(
        reasons.contains(&"ground:fingertip") && reasons.contains(&"contact_too_small"),
        "{reasons:?}"
    );
    let (by, reason) = (column(&page, "miss_by"), numbers(&page, "miss_reason"));
    assert!(by.len() > 60 && by.len() == reason.len() && by.iter().all(|by| *by > 0.0));
    assert_eq!(column(&page, "miss_place").len(), 3 * by.len());
}

#[test]
fn a_grip_under_an_unknown_load_is_refused() {
    let (mut set, _) = fixture();
    set.grips[3].worst.load = 99;
    let error = report::render(&set, None, &[]).unwrap_err();
    assert!(
        error.kind() == ErrorKind::Mismatch && error.to_string().contains("load 99"),
        "{error}"
    );
}

#[test]
fn the_command_writes_a_page_and_refuses_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let (set, mesh) = fixture();
    let grips = folder.path().join("grips.json");
    set.write(&grips).unwrap();
    let run = |args: &[&str]| {
        let output = cargo_bin_cmd!("gripfast")
            .current_dir(folder.path())
            .arg("report")
            .args(args)
            .output()
            .unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, text) = run(&["grips.json"]);
    assert_eq!(code, Some(0), "{text}");
    let page = std::fs::read_to_string(folder.path().join("grips.html")).unwrap();
    assert_eq!(header(&page)["display"]["shown"], mesh.triangles.len());

    let other = data("parts/hex_nut.stl").display().to_string();
    let (code, text) = run(&["grips.json", "--part", &other, "-o", "other.html"]);
    assert!(code == Some(2) && text.contains("not the part of this result"), "{text}");
    assert!(!folder.path().join("other.html").exists());
    let (code, text) = run(&["grips.json", "-o", "grips.json"]);
    assert!(code == Some(2) && text.contains("result file itself"), "{text}");

    let mut moved = set;
    moved.part.file = "nowhere.stl".into();
    moved.write(&grips).unwrap();
    let (code, text) = run(&["grips.json", "-o", "box.html"]);
    assert!(code == Some(0) && text.contains("bounding box"), "{text}");
    std::fs::write(&grips, "{ \"format\": \"something else\" }").unwrap();
    assert_eq!(run(&["grips.json"]).0, Some(2));
}
