//! Disks that are full or read-only and systems without files left: every write ends with an error
//! that names its file, and nothing half-written takes a final name.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::{root, say};

/// A file system of its own that is full, or read-only; gone at the end.
struct Disk {
    folder: tempfile::TempDir,
}

impl Disk {
    /// One page, taken by `kept.json`: no byte more fits. `None` where none can be mounted.
    fn full() -> Option<Self> {
        let disk = Self::mounted("size=4096")?;
        std::fs::write(disk.path("kept.json"), vec![b'x'; 4096]).unwrap();
        Some(disk)
    }

    fn read_only() -> Option<Self> {
        let disk = Self::mounted("size=65536")?;
        std::fs::write(disk.path("kept.json"), "kept").unwrap();
        let folder = disk.folder.path();
        let again = Command::new("mount").args(["-o", "remount,ro"]).arg(folder).status().unwrap();
        assert!(again.success());
        Some(disk)
    }

    fn mounted(options: &str) -> Option<Self> {
        let folder = tempfile::tempdir().unwrap();
        let mount = Command::new("mount")
            .args(["-t", "tmpfs", "-o", options, "tmpfs"])
            .arg(folder.path())
            .output();
        if mount.is_ok_and(|mount| mount.status.success()) {
            return Some(Self { folder });
        }
        say("SKIPPED: full and read-only disks: mounting one needs root");
        None
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The names in it, but for the file that was there.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name != "kept.json").collect()
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.folder.path()).status();
    }
}

fn part() -> String {
    root().join("data/parts/hex_nut.stl").display().to_string()
}

/// The output's exit code and errors.
fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let output = assert_cmd::Command::cargo_bin("gripfast")
        .unwrap()
        .args(arguments)
        .timeout(std::time::Duration::from_secs(60))
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// A result file on a good disk, and a case of one contact pair.
fn inputs(folder: &Path) -> [String; 2] {
    let (grips, case) = (folder.join("grips.json"), folder.join("case.json"));
    let [grips, case_name] = [&grips, &case].map(|path| path.display().to_string());
    let (code, errors) = run(&[
        "plan",
        &part(),
        "-g",
        "generic",
        "--mass",
        "20g",
        "--spacing",
        "9mm",
        "--angle-step",
        "90deg",
        "-o",
        &grips,
    ]);
    assert_eq!(code, Some(0), "{errors}");
    let area = r#"[{"outer":[[-0.01,-0.01],[0.01,-0.01],[0.01,0.01],[-0.01,0.01]]}]"#;
    let text =
        format!(r#"{{"A_I":{area},"A_II":{area},"d":0.02,"Fn":100,"F":[1,0,0],"M":[0,0,0.1]}}"#);
    std::fs::write(&case, text).unwrap();
    [grips, case_name]
}

/// Every command that writes a file, with the file's name on the bad disk.
fn writes<'a>(grips: &'a str, case: &'a str, part: &'a str) -> Vec<(Vec<&'a str>, &'static str)> {
    let coarse = ["-g", "generic", "--mass", "20g", "--spacing", "9mm", "--angle-step", "90deg"];
    let plan = |flag| [&["plan", part][..], &coarse[..], &[flag][..]].concat();
    let export = |format| vec!["export", grips, "--format", format, "-o"];
    vec![
        (plan("-o"), "out.json"),
        (plan("--report"), "page.html"),
        (export("csv"), "out.csv"),
        (export("jsonl"), "out.jsonl"),
        (export("isaac_grasp"), "out.yaml"),
        (export("graspnet"), "out.npz"),
        (vec!["export", grips, "--part", part, "--format", "glb", "-o"], "out.glb"),
        (vec!["report", grips, "--part", part, "-o"], "page.html"),
        (vec!["part", part, "--plot"], "part.svg"),
        (vec!["gripper", "check", "generic", "--svg"], "gripper.svg"),
        (vec!["solve", case, "--plot"], "solve.svg"),
        (vec!["score", case, "-o"], "scores.jsonl"),
    ]
}

#[test]
fn a_disk_that_is_full_or_read_only_is_an_error_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let [grips, case] = inputs(folder.path());
    let part = part();
    for disk in [Disk::full(), Disk::read_only()] {
        let Some(disk) = disk else { return };
        for (arguments, name) in writes(&grips, &case, &part) {
            let output = disk.path(name).display().to_string();
            let arguments: Vec<&str> = arguments.into_iter().chain([output.as_str()]).collect();
            let (code, errors) = run(&arguments);
            assert_eq!(code, Some(2), "{arguments:?}: {errors}");
            assert!(errors.contains("error: ") && errors.contains(name), "{arguments:?}: {errors}");
            assert_eq!(disk.names(), [""; 0], "{arguments:?}");
        }
        // An older result is as it was.
        let kept = disk.path("kept.json");
        let before = std::fs::read(&kept).unwrap();
        let output = kept.display().to_string();
        assert_eq!(run(&["export", &grips, "-o", &output]).0, Some(2));
        assert_eq!(std::fs::read(&kept).unwrap(), before);
    }
}

#[cfg(unix)]
#[test]
fn no_file_left_to_open_is_an_error() {
    let program = assert_cmd::cargo::cargo_bin("gripfast").display().to_string();
    for files in [3, 4, 5, 8] {
        let line = format!("ulimit -n {files}; exec '{program}' part '{}'", part());
        let output = Command::new("sh").args(["-c", &line]).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!errors.contains("panicked"), "{files}: {errors}");
        assert!(
            matches!(output.status.code(), Some(0 | 1 | 2 | 127)),
            "{files}: {:?}",
            output.status
        );
    }
}
