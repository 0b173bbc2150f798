//! The page in a real browser: see `viewer/test/browser.mjs` for what is checked.
//!
//! Needs node, Chromium and the packages of `viewer/` (`npm ci` there); says SKIPPED without them,
//! or fails when the environment variable `GRIPFAST_BROWSER` is `require`. `GRIPFAST_SCREENSHOTS`
//! names a folder for pictures.

use std::io::Write;
use std::path::Path;
use std::process::Command;

use crate::support::report::{data, large, part, plan, refined};
use gripfast::report;

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
    let (small_page, large_page) =
        (folder.path().join("small.html"), folder.path().join("large.html"));
    let fine = refined(&part.mesh, 6);
    let mut many = large(&set, 10_000);
    many.part.triangles = fine.triangles.len();
    report::write(&many, Some(&fine), &large_page).unwrap();
    set.part.file = "</script><img src=x onerror=alert(1)>.stl".into();
    report::write(&set, Some(&part.mesh), &small_page).unwrap();
    let mut command = Command::new("node");
    command
        .arg(viewer.join("test/browser.mjs"))
        .args([&small_page, &large_page])
        .args(std::env::var_os("GRIPFAST_SCREENSHOTS"));
    let output = command.env("CHROMIUM", browser).output().unwrap();
    let text = [output.stdout, output.stderr]
        .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        .concat();
    println!("{text}");
    assert!(output.status.success(), "{text}");
}
