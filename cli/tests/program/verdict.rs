//! What *holds* means: by the pads' friction and the safety asked for, everywhere alike.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use glam::DVec3;
use gripfast::load::wrench_in_grip;
use gripfast::mechanics::{Options, Pads, inverse, solve};
use gripfast::results::{ForceRange, GripSet, LoadCase, RankedGrip};

fn gripfast(folder: &Path, line: &str) -> Output {
    Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(folder)
        .args(line.split_whitespace())
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs `plan .. -q -o grips.json` with this exit code: the set, what was printed, and warned.
fn plan(folder: &Path, line: &str, code: i32) -> (GripSet, String, String) {
    let output = gripfast(folder, &format!("plan {line} --backend cpu -q -o grips.json"));
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(code), "{line}: {out}{err}");
    (GripSet::read(&folder.join("grips.json")).unwrap(), out, err)
}

fn part(name: &str) -> String {
    crate::support::root().join("data/parts").join(name).display().to_string()
}

fn mu(ranked: &RankedGrip) -> f64 {
    ranked.worst.mu_s.unwrap()
}

#[test]
fn no_grip_holds_what_the_pads_cannot() {
    let Some(trial) = crate::support::reference("trials/verdict/block.stl") else { return };
    let gripper = trial.with_file_name("egp4.toml").display().to_string();
    let folder = tempfile::tempdir().unwrap();
    let line = format!(
        "{} -g {gripper} --mass 3.5kg --accel 1g --spacing 10mm --angle-step 90deg",
        trial.display()
    );
    let (set, out, err) = plan(folder.path(), &line, 1);
    assert!(out.contains("0 of ") && out.contains("hold with the pads' 0.2 at 140 N per jaw"));
    assert!(err.contains("79.7 g/cm3"), "steel has a tenth of that: {err}");
    assert!(set.grips.len() > 100 && set.summary.holding == Some(0) && !set.any_holds());
    assert!(set.grips.iter().all(|grip| grip.holds == Some(false) && mu(grip) > 0.2));
    // What the best needs, from the equations: at that force the pads' friction is just enough.
    let best = set
        .grips
        .iter()
        .min_by(|a, b| a.force_needed.unwrap().total_cmp(&b.force_needed.unwrap()))
        .unwrap();
    let needed = best.force_needed.unwrap();
    assert!(out.contains(&format!("(the best needs {needed:.0} N)")), "{needed}: {out}");
    let (grip, wrench) = (&best.grip, &best.worst.wrench);
    let at = |force: f64| {
        solve(&grip.contact, grip.width, force, wrench, &Options::default()).unwrap().mu_s.unwrap()
    };
    assert!(needed > 140.0 && (at(needed) / 0.2 - 1.0).abs() < 1e-6);
    assert_eq!(set.force_range(best), Some(ForceRange::Above));
    assert!(out.contains(&format!("{needed:.2}+")) || best.rank > 10, "{out}");

    // Confidence stays below a half, and nothing is picked unless slip is allowed.
    let exported = gripfast(folder.path(), "export grips.json --format isaac_grasp -o -");
    let yaml = text(&exported.stdout);
    let confidences: Vec<f64> = yaml
        .lines()
        .filter_map(|line| line.trim().strip_prefix("confidence: "))
        .map(|value| value.parse().unwrap())
        .collect();
    assert!(confidences.len() == set.grips.len() && confidences.iter().all(|q| *q < 0.5));
    assert!(yaml.contains("# warning: the part would be 79.7 g/cm3 dense"));
    std::fs::write(folder.path().join("scene.toml"), "").unwrap();
    let picked = gripfast(folder.path(), "pick grips.json --scene scene.toml");
    let (out, err) = (text(&picked.stdout), text(&picked.stderr));
    assert!(picked.status.code() == Some(1) && out.contains("--allow-slip"), "{out}");
    assert!(out.contains("slips: the pads have 36 %") && err.contains("79.7 g/cm3"), "{out}{err}");
    let picked = gripfast(folder.path(), "pick grips.json --scene scene.toml --allow-slip");
    assert!(picked.status.code() == Some(0) && text(&picked.stdout).contains("but it slips"));
}

#[test]
fn a_bar_is_held_where_its_moment_is_small_enough() {
    let Some(trial) = crate::support::reference("trials/bars/bar1m.stl") else { return };
    let folder = tempfile::tempdir().unwrap();
    let base = format!(
        "{} -g robotiq-2f85 --density 2700kg/m3 --spacing 10mm --angle-step 90deg",
        trial.display()
    );
    let (set, out, _) = plan(folder.path(), &base, 0);
    let holding = set.grips.iter().filter(|grip| mu(grip) <= 0.5).count();
    assert!(holding >= 380 && holding < set.grips.len(), "{holding}");
    let line = format!("{holding} of {} grips hold with the pads' 0.5 at 235 N", set.grips.len());
    assert!(out.contains(&line) && set.summary.holding == Some(holding as u64), "{out}");
    // Those that hold, then those that slip, both by falling score.
    let (held, slipping) = set.grips.split_at(holding);
    assert!(held.iter().all(|grip| grip.holds == Some(true) && mu(grip) <= 0.5));
    assert!(slipping.iter().all(|grip| grip.holds == Some(false) && mu(grip) > 0.5));
    for list in [held, slipping] {
        let falls =
            |pair: &[RankedGrip]| pair[0].score.unwrap() >= pair[1].score.unwrap() * (1.0 - 1e-9);
        assert!(list.windows(2).all(falls));
    }
    // A safety of 2 asks for half the friction; the force needed is that for it.
    let (safe, out, _) = plan(folder.path(), &format!("{base} --safety 2 --keep 20000"), 0);
    let fewer = set.grips.iter().filter(|grip| 2.0 * mu(grip) <= 0.5).count();
    assert!(fewer < holding && safe.summary.holding == Some(fewer as u64), "{fewer}");
    assert!(out.contains("the pads' 0.5 and a safety of 2 at 235 N per jaw"), "{out}");
    for grip in safe.grips.iter().step_by(50) {
        let pads = Pads::new(&grip.grip.contact).unwrap();
        let (wrench, options) = (&grip.worst.wrench, Options::default());
        let needed = inverse::force_needed(&pads, grip.grip.width, wrench, 0.25, &options);
        assert_eq!(grip.force_needed, needed);
    }
    // Only the best are solved to the end, and they are the same.
    let (few, ..) = plan(folder.path(), &format!("{base} --safety 20 --polish top --keep 40"), 0);
    let (all, ..) = plan(folder.path(), &format!("{base} --safety 20"), 0);
    assert!(all.summary.holding.unwrap() < 40, "some of the best slip");
    let ids = |set: &GripSet| -> Vec<u64> {
        set.grips.iter().take(40).map(|grip| grip.grip.id).collect()
    };
    assert_eq!(ids(&few), ids(&all));
    // No verdict without a friction, and a result of before says as much as it can.
    let mut value = serde_json::to_value(&set).unwrap();
    value["summary"].as_object_mut().unwrap().remove("holding");
    let resolved = value["provenance"]["resolved"].as_object_mut().unwrap();
    resolved.remove("safety");
    let old: GripSet = serde_json::from_value(value.clone()).unwrap();
    assert_eq!(old.holding(), Some(holding as u64));
    value["provenance"]["resolved"]["pad_friction"] = serde_json::Value::Null;
    let unknown: GripSet = serde_json::from_value(value).unwrap();
    assert!(unknown.holding().is_none() && unknown.any_holds());
}

#[test]
fn the_force_needed_is_one_number() {
    let Some(trial) = crate::support::reference("trials/limit-states/inside_force_needed.json")
    else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let output =
        gripfast(folder.path(), &format!("solve {} --pad-friction 0.5 --json", trial.display()));
    let needed: Vec<f64> = text(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
        .filter(|answer| answer["id"].as_str().unwrap().contains("d=-width"))
        .map(|answer| answer["force_needed"].as_f64().unwrap())
        .collect();
    assert_eq!(needed.len(), 8);
    for (found, right) in needed.iter().zip([7.317, 5.744, 5.427]) {
        assert!((found - right).abs() < 5e-4, "{found} {right}");
    }
    let line = format!(
        "{} -g generic --mass 300g --grips inside --loads gravity:12 --spacing 5mm \
         --angle-step 45deg",
        part("pocket_plate.stl")
    );
    let (set, ..) = plan(folder.path(), &line, 0);
    let (mut seen, mut others) = (0, 0);
    for ranked in &set.grips {
        let grip = &ranked.grip;
        let pads = Pads::new(&grip.contact).unwrap();
        let options = Options::default();
        let force = |load: &LoadCase| {
            let centre = set.part.mass.centre_of_mass;
            let wrench = wrench_in_grip(&load.wrench, centre, &grip.part_from_grip);
            inverse::force_needed(&pads, grip.distance(), &wrench, 0.5, &options).unwrap()
        };
        let forces: Vec<f64> = set.loads.iter().map(force).collect();
        let most = forces.iter().copied().fold(0.0, f64::max);
        let needed = ranked.force_needed.unwrap();
        assert!((needed / most - 1.0).abs() < 2e-6, "{}: {needed} {most}", grip.id);
        assert_eq!(ranked.load_multiple, Some(150.0 / needed));
        others += usize::from(forces[ranked.worst.load as usize] < 0.99 * most);
        seen += usize::from(grip.inside);
    }
    assert!(seen > 20 && others > 0, "{seen} {others}");
}

#[test]
fn loads_over_payload_and_moments_are_told_with_the_number() {
    let folder = tempfile::tempdir().unwrap();
    let shipped = crate::support::root().join("data/grippers/robotiq-2f85.toml");
    let shipped = std::fs::read_to_string(shipped).unwrap();
    let write = |name: &str, lines: &str| {
        std::fs::write(folder.path().join(name), format!("{lines}\n{shipped}")).unwrap();
    };
    write("payload.toml", "payload = \"500g\"");
    write("moment.toml", "moment = [\"5Nm\", \"5Nm\", \"0.03Nm\"]");
    let line = |gripper: &str| {
        let part = part("l_bracket.stl");
        format!("{part} -g {gripper} --mass 350g --spacing 10mm --angle-step 45deg")
    };
    let (all, ..) = plan(folder.path(), &line("robotiq-2f85"), 0);
    std::fs::copy(folder.path().join("grips.json"), folder.path().join("all.json")).unwrap();
    let (same, ..) = plan(folder.path(), &line("payload.toml"), 0);
    assert_eq!(all.grips, same.grips, "350 g are no more than 500 g");
    let heavy = line("payload.toml") + " --accel 1g";
    let (none, out, err) = plan(folder.path(), &heavy, 1);
    assert!(none.grips.is_empty() && out.contains("over payload:0.5 kg"), "{out}");
    assert!(err.contains("6.9 N is over the payload") && err.contains("4.9 N"), "{err}");
    assert!(none.provenance.warnings.iter().any(|text| text.contains("over the payload")));

    // Gravity of 3.43 N along the axes, about the middle between the pads.
    let weight = 0.35 * 9.80665;
    let over = |ranked: &&RankedGrip| {
        let grip = ranked.grip.part_from_grip;
        let arm = all.part.mass.centre_of_mass - grip.origin;
        DVec3::AXES.iter().any(|down| {
            let moment = grip.rotation.transpose() * arm.cross(*down * weight);
            moment.z.abs() > 0.03
        })
    };
    let expected = all.grips.iter().filter(over).count();
    assert!(expected > 10 && expected < all.grips.len() - 10, "{expected}");
    let (fewer, out, _) = plan(folder.path(), &line("moment.toml"), 0);
    assert!(out.contains(&format!("{expected} over moment:x3 0.03 Nm")), "{expected}: {out}");
    let left: Vec<u64> = all.grips.iter().filter(|g| !over(g)).map(|g| g.grip.id).collect();
    assert_eq!(fewer.grips.iter().map(|g| g.grip.id).collect::<Vec<_>>(), left);

    // The same of poses from outside, and of one that is asked about.
    let line = format!("{} -g moment.toml --mass 350g", part("l_bracket.stl"));
    let told = text(&gripfast(folder.path(), &format!("assess {line} --poses all.json")).stdout);
    assert!(told.contains(&format!("{expected} over moment:x3 0.03 Nm")), "{expected}: {told}");
    let pose = all.grips.iter().find(over).unwrap().grip.part_from_grip;
    let list = |v: DVec3, unit: &str| v.to_array().map(|value| format!("{value}{unit}"));
    let axes = [pose.rotation.x_axis, pose.rotation.z_axis];
    let [x, z] = axes.map(|axis| list(axis, "").join("/"));
    let output = gripfast(
        folder.path(),
        &format!("plan {line} --spacing 10mm --why={}:{x}:{z}", list(pose.origin, "m").join(",")),
    );
    let (told, err) = (text(&output.stdout), text(&output.stderr));
    assert!(told.contains("rejected: over moment:x3 0.03 Nm"), "{told}{err}");
    assert_eq!(output.status.code(), Some(1), "{told}{err}");

    let told = text(&gripfast(folder.path(), "gripper check moment.toml").stdout);
    assert!(told.contains("5, 5, 0.03 Nm") && told.contains("N per jaw"), "{told}");
    for (lines, word) in [("payload = \"0kg\"", "payload"), ("moment = [\"1Nm\"]", "length 3")] {
        write("bad.toml", lines);
        let output = gripfast(folder.path(), "gripper check bad.toml");
        assert!(output.status.code() == Some(2) && text(&output.stderr).contains(word));
    }
}

#[test]
fn an_assembly_has_its_own_centre_of_mass_and_inertia() {
    let folder = tempfile::tempdir().unwrap();
    let line = format!(
        "{} -g robotiq-2f85 --mass 350g --spacing 10mm --angle-step 90deg",
        part("l_bracket.stl")
    );
    let own = "--com 30mm,20mm,5mm --inertia 300kgmm2,400kgmm2,500kgmm2,10kgmm2,0kgmm2,-20kgmm2";
    let (set, out, err) = plan(folder.path(), &format!("{line} {own} --max-offset 15mm"), 0);
    assert!(out.contains("centre of mass (30.00, 20.00, 5.00) mm") && err.is_empty(), "{out}{err}");
    let mass = &set.part.mass;
    let centre = DVec3::new(0.03, 0.02, 0.005);
    assert_eq!(mass.centre_of_mass, centre);
    let rows = [[300e-6, 10e-6, -20e-6], [10e-6, 400e-6, 0.0], [-20e-6, 0.0, 500e-6]];
    for (row, values) in rows.iter().enumerate() {
        for (column, value) in values.iter().enumerate() {
            assert!((mass.inertia.col(column)[row] - value).abs() < 1e-18);
        }
    }
    assert!(!set.grips.is_empty());
    for ranked in &set.grips {
        let grip = ranked.grip.part_from_grip;
        assert!(grip.origin.distance(centre) <= 0.015 + 1e-12);
        let load = &set.loads[ranked.worst.load as usize].wrench.force;
        let moment = grip.rotation.transpose() * (centre - grip.origin).cross(*load);
        assert!((moment - ranked.worst.wrench.moment).length() < 1e-12);
    }
    let (.., err) = plan(folder.path(), &format!("{line} --com 1m,0mm,0mm"), 0);
    assert!(err.contains("outside of the part's bounding box"), "{err}");
    for (wrong, word) in [
        ("--com 1mm,2mm", "not 3 values"),
        ("--com 1mm,2mm,3", "no unit"),
        ("--inertia 1kgm2,1kgm2,3kgm2,0kgm2,0kgm2,0kgm2", "no body"),
        ("--inertia 1kgm2,1kgm2,1kgm2,2kgm2,0kgm2,0kgm2", "no body"),
    ] {
        let output = gripfast(folder.path(), &format!("plan {line} {wrong}"));
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains(word), "{wrong}: {err}");
    }
}

#[test]
fn grippers_are_compared_and_flags_given_twice_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let base = format!(
        "plan {} --mass 350g --accel 2g --spacing 10mm --angle-step 90deg --backend cpu -q",
        part("l_bracket.stl")
    );
    let two = "-g robotiq-2f85 -g onrobot-rg2";
    let output = gripfast(at, &format!("{base} {two} -o grips.json --report page.html"));
    let out = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{out}{}", text(&output.stderr));
    let is_row = |line: &&str| line.contains(" holds ") && !line.starts_with("force N");
    let rows: Vec<&str> = out.lines().filter(is_row).collect();
    assert!(rows.len() == 2 && rows[0].contains("2F-85") && rows[1].contains("RG2"), "{out}");
    // Without files only the first grips are solved to the end; they are the same.
    let table = gripfast(at, &format!("{base} {two}"));
    let table = text(&table.stdout);
    assert!(table.lines().filter(is_row).eq(rows.iter().copied()), "{table}");
    for name in ["robotiq-2f85", "onrobot-rg2"] {
        let set = GripSet::read(&at.join(format!("grips.{name}.json"))).unwrap();
        assert_eq!(set.provenance.request.gripper, name);
        assert!(at.join(format!("page.{name}.html")).exists());
        let alone = gripfast(at, &format!("{base} -g {name} -o alone.json"));
        assert_eq!(alone.status.code(), Some(0));
        let alone = GripSet::read(&at.join("alone.json")).unwrap();
        let scores = |set: &GripSet| -> Vec<(u64, Option<f64>)> {
            set.grips.iter().map(|grip| (grip.grip.id, grip.worst.mu_s)).collect()
        };
        assert_eq!(scores(&alone), scores(&set));
    }
    // Forces and pads: the force needed is the same, what holds is not.
    let pads = "-g robotiq-2f85 --force 30N --force 60N --pad-friction 0.3 --pad-friction 0.6";
    let output = gripfast(at, &format!("{base} {pads} -o pads.json"));
    let out = text(&output.stdout);
    let four = ["30 N, pads 0.3", "30 N, pads 0.6", "60 N, pads 0.3", "60 N, pads 0.6"];
    let rows =
        out.lines().filter(|line| line.starts_with("Robotiq 2F-85,") && !line.contains(": "));
    assert!(rows.zip(four).all(|(row, name)| row.contains(name)), "{out}");
    for (force, friction) in [(30, 0.3), (30, 0.6), (60, 0.3), (60, 0.6)] {
        let set = at.join(format!("pads.{force}N-mu{friction}.json"));
        let set = GripSet::read(&set).unwrap();
        let one = format!("-g robotiq-2f85 --force {force}N --pad-friction {friction}");
        gripfast(at, &format!("{base} {one} -o alone.json"));
        assert_eq!(set.grips, GripSet::read(&at.join("alone.json")).unwrap().grips);
    }
    // Masses: the part is told without its mass.
    let output = gripfast(at, &format!("{base} -g robotiq-2f85 --mass 2kg -o masses.json"));
    let out = text(&output.stdout);
    assert!(
        out.contains("Robotiq 2F-85, 350 g: ") && out.contains("Robotiq 2F-85, 2 kg: "),
        "{out}"
    );
    assert!(out.lines().next().unwrap().ends_with("688 triangles"), "{out}");
    for (tag, mass) in [("0.35kg", 0.35), ("2kg", 2.0)] {
        let set = GripSet::read(&at.join(format!("masses.{tag}.json"))).unwrap();
        assert!((set.part.mass.mass - mass).abs() < 1e-12, "{tag}");
    }
    for (line, word) in [
        (format!("{base} {two} --force 40N --force 40N"), "given twice"),
        (format!("{base} {two} --poses x.csv").replacen("plan", "assess", 1), "several times"),
        (format!("{base} {two} --mass 0.35kg"), "given twice"),
        (format!("{base} {two} --mass 1kg --poses x.csv").replacen("plan", "assess", 1), "several"),
        (format!("{base} {two} --accel 1g"), "multiple times"),
        (format!("{base} -g generic -g generic"), "given twice"),
        (format!("{base} {two} --json"), "--json"),
        (format!("{base} {two} --why 0mm,0mm,0deg,0"), "--why"),
    ] {
        let output = gripfast(at, &line);
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains(word), "{line}: {err}");
    }
    // Where none holds the part and the reasons are told, notes by the gripper that they are about,
    // and warnings once.
    let wide = format!("plan {} --mass 5kg --spacing 20mm --backend cpu", part("pocket_plate.stl"));
    let output = gripfast(at, &format!("{wide} -g robotiq-hande -g robotiq-2f85 --force 30N"));
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(1), "{out}");
    assert!(out.contains("pocket_plate.stl: 120.0 x 80.0 x 16.0 mm"), "{out}");
    assert_eq!(out.lines().filter(|line| line.starts_with("  rejected: ")).count(), 2, "{out}");
    assert_eq!(
        err.lines().filter(|line| line.starts_with("warning: the part")).count(),
        1,
        "{err}"
    );
    assert!(err.lines().any(|line| line.starts_with("Robotiq ")), "{err}");
    // A project's default gives way to the flag.
    std::fs::write(
        at.join("gripfast.toml"),
        "[plan]\ngripper = [\"generic\", \"x\"]\nmass = \"1kg\"\n",
    )
    .unwrap();
    let output = gripfast(at, &format!("{base} -g generic"));
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn the_table_fits_a_page_and_names_approach_and_pad() {
    let folder = tempfile::tempdir().unwrap();
    let line = format!(
        "{} -g robotiq-2f85 --mass 350g --accel 2g --spacing 8mm --angle-step 45deg \
         --pose-noise 1mm,1deg --noise-samples 4 --compare",
        part("l_bracket.stl")
    );
    let (set, out, err) = plan(folder.path(), &line, 0);
    let lines: Vec<&str> = out.lines().collect();
    let head = lines.iter().position(|line| line.trim_start().starts_with("rank ")).unwrap();
    let table = &lines[head..head + 11];
    assert!(table.iter().all(|line| line.trim_end().chars().count() <= 120), "{out}");
    assert!(!out.contains("next: ") && err.is_empty(), "no hint where nobody watches");
    let columns: Vec<&str> = table[0].split("  ").map(str::trim).collect();
    assert!(columns.contains(&"approach") && columns.contains(&"pad"), "{columns:?}");
    // The best grip's approach and its share of the pad, worked out here.
    let best = &set.grips[0].grip;
    let area = |ring: &Vec<glam::DVec2>| {
        let sum: f64 =
            (0..ring.len()).map(|k| ring[k].perp_dot(ring[(k + 1) % ring.len()]) / 2.0).sum();
        sum.abs()
    };
    let touching = |patch: &gripfast::model::Patch| -> f64 {
        patch.iter().map(|p| area(&p.outer) - p.holes.iter().map(area).sum::<f64>()).sum()
    };
    let share =
        touching(&best.contact.face_i).min(touching(&best.contact.face_ii)) / (0.0335 * 0.02);
    let x1 = best.part_from_grip.rotation.x_axis;
    let axis = [
        ("+x", DVec3::X),
        ("+y", DVec3::Y),
        ("+z", DVec3::Z),
        ("-x", -DVec3::X),
        ("-y", -DVec3::Y),
        ("-z", -DVec3::Z),
    ]
    .into_iter()
    .find(|(_, axis)| axis.dot(x1) > 1.0 - 1e-9)
    .unwrap()
    .0;
    let words: Vec<&str> = table[1].split_whitespace().collect();
    assert!(words.contains(&axis), "{axis}: {}", table[1]);
    assert!(words.contains(&format!("{:.0}", share * 100.0).as_str()), "{share}: {}", table[1]);
}

#[test]
fn exports_and_pages_take_the_grips_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let base = "--spacing 10mm --angle-step 90deg --backend cpu -q";
    for (name, gripper) in [("a", "robotiq-2f85"), ("b", "franka-hand")] {
        let line = format!(
            "plan {} -g {gripper} --mass 350g {base} -o {name}.json",
            part("l_bracket.stl")
        );
        assert_eq!(gripfast(at, &line).status.code(), Some(0));
    }
    let (a, b) =
        (GripSet::read(&at.join("a.json")).unwrap(), GripSet::read(&at.join("b.json")).unwrap());
    let rows = |line: &str| -> Vec<Vec<String>> {
        let output = gripfast(at, &format!("export {line} --format csv -o -"));
        assert_eq!(output.status.code(), Some(0), "{line}: {}", text(&output.stderr));
        let mut reader = csv::Reader::from_reader(&output.stdout[..]);
        let names = ["id", "gripper", "verdict", "mass_kg", "force_n", "face_i", "face_ii", "part"];
        let heads = reader.headers().unwrap().clone();
        let places = names.map(|name| heads.iter().position(|head| head == name).unwrap());
        reader
            .records()
            .map(|row| {
                let row = row.unwrap();
                places.iter().map(|place| row[*place].to_owned()).collect()
            })
            .collect()
    };
    let all = rows("a.json b.json");
    assert_eq!(all.len(), a.grips.len() + b.grips.len());
    assert_eq!((&all[0][1][..], &all[a.grips.len()][1][..]), ("Robotiq 2F-85", "Franka Hand"));
    assert_eq!((&all[0][3][..], &all[0][4][..]), ("0.35", "235.0"));
    assert!(all.iter().all(|row| row[2] == "holds" && row[7].ends_with("l_bracket.stl")));
    let third = a.grips[2].grip.id;
    let first = a.grips[0].grip.id;
    let ids = |rows: Vec<Vec<String>>| -> Vec<u64> {
        rows.iter().map(|row| row[0].parse().unwrap()).collect()
    };
    assert_eq!(ids(rows(&format!("a.json --ids {third},{first}"))), [first, third]);
    let faces = rows("a.json --faces 2,3");
    assert!(!faces.is_empty() && faces.len() < a.grips.len());
    assert!(
        faces
            .iter()
            .all(|row| ["2", "3"].contains(&&row[5][..]) && ["2", "3"].contains(&&row[6][..]))
    );
    // As `plan --diverse` shows them, and keeps them where a number is given.
    let shown = gripfast(
        at,
        &format!(
            "plan {} -g robotiq-2f85 --mass 350g {base} --diverse --top 4 --keep 4 -o four.json",
            part("l_bracket.stl")
        ),
    );
    assert_eq!(shown.status.code(), Some(0));
    let four = GripSet::read(&at.join("four.json")).unwrap();
    let kept: Vec<u64> = four.grips.iter().map(|grip| grip.grip.id).collect();
    assert_eq!(ids(rows("a.json --diverse --top 4")), kept);
    let down = rows("a.json --approach=-z:1deg");
    let expected =
        a.grips.iter().filter(|g| g.grip.part_from_grip.rotation.x_axis.z < -0.9999).count();
    assert!(expected > 0 && down.len() == expected);
    assert_eq!(gripfast(at, "report a.json --diverse --top 4 -o four.html").status.code(), Some(0));
    let again = format!(
        "plan {} -g robotiq-2f85 --mass 350g {base} --ids {third},{first} -o two.json",
        part("l_bracket.stl")
    );
    assert_eq!(gripfast(at, &again).status.code(), Some(0));
    let two = GripSet::read(&at.join("two.json")).unwrap();
    assert_eq!(two.grips.iter().map(|g| g.grip.id).collect::<Vec<_>>(), [first, third]);
    for (line, word) in [
        ("export a.json b.json -o all.npz", "csv or parquet"),
        ("export a.json -o a.csv --ids 99999999", "no grip 99999999"),
        ("export a.json -o a.csv --diverse", "--top"),
        ("report a.json --ids 99999999", "--ids"),
    ] {
        let output = gripfast(at, line);
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains(word), "{line}: {err}");
    }
}

#[test]
fn small_mistakes_are_told_plainly() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let base = format!("plan {} -g generic", part("hex_nut.stl"));
    for (line, word) in [
        (format!("{base} --mass 0,35kg"), "write a point: 0.35kg"),
        (format!("{base} --mass 20g --safety 0"), "above zero"),
        (format!("{base} --mass -350g"), "--mass=-350g"),
        (format!("{base} --mass 20g --force -3N"), "--force=-3N"),
        (format!("{base} --mass 20g --ids 3,b"), "as the table lists them"),
        (format!("{base} --mass 20g --min-contact half"), "or 50%"),
        (part("hex_nut.stl"), "say what to do with this file"),
        (format!("{base} --mass 20g --report nowhere/page.html"), "'nowhere' is not there"),
    ] {
        let output = gripfast(at, &line);
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains(word), "{line}: {err}");
    }
    for (gripper, word) in [
        ("stroke = 10", "stroke = [\"0mm\", \"85mm\"]"),
        ("[finger]\nname = \"x\"", "[[finger]]"),
        ("[pad]\nfriction = \"0.5\"", "plain number"),
    ] {
        std::fs::write(at.join("g.toml"), format!("name = \"x\"\n{gripper}\n")).unwrap();
        let output = gripfast(at, "gripper check g.toml");
        let err = text(&output.stderr);
        assert!(output.status.code() == Some(2) && err.contains(word), "{gripper}: {err}");
    }
    // Grips that this search does not have are named, whatever else is quiet.
    let output = gripfast(at, &format!("{base} --mass 20g --spacing 10mm --ids 99999999 -q"));
    let err = text(&output.stderr);
    assert!(output.status.code() == Some(1) && err.contains("no grip is 99999999"), "{err}");
    // The unit that would give a usual density.
    let bracket = format!("plan {} -g generic --spacing 20mm --mass 186g", part("l_bracket.stl"));
    for (unit, fits) in [("in", true), ("mm", false)] {
        let err = text(&gripfast(at, &format!("{bracket} --unit {unit} -q")).stderr);
        let named = err.contains("the unit mm would give 7.9 g/cm3 (--unit mm)");
        assert_eq!(named, fits, "{unit}: {err}");
    }
    // A file in metres read as millimetres: the warning comes also when it is quiet.
    let Some(battery) = crate::support::reference("trials/verdict/battery_in_metres.stl") else {
        return;
    };
    let line = format!("plan {} -g generic --mass 50g -q", battery.display());
    let output = gripfast(at, &line);
    let err = text(&output.stderr);
    assert!(output.status.code() == Some(1) && err.contains("--unit m"), "{err}");
}

#[test]
fn a_turn_about_a_centre_beyond_all_measure_is_told_as_a_slide() {
    let folder = tempfile::tempdir().unwrap();
    let square = "[{\"outer\":[[0,0],[0.01,0],[0.01,0.01],[0,0.01]],\"holes\":[]}]";
    for (moment, words) in [
        (1e-6, "counter-clockwise about"),
        (1e-13, "about to slide                            along (0.6000, 0.8000)"),
    ] {
        // About the middle of the square.
        let m3 = 0.005 * 0.8 - 0.005 * 0.6 + moment;
        let case = format!(
            "{{\"A_I\":{square},\"A_II\":{square},\"d\":0.02,\"Fn\":50,\"F\":[0.6,0.8,0],\"M\":[0,0,{m3:e}]}}"
        );
        std::fs::write(folder.path().join("case.json"), case).unwrap();
        let output = gripfast(folder.path(), "solve case.json");
        let out = text(&output.stdout);
        assert!(output.status.code() == Some(0) && out.contains(words), "{moment}: {out}");
    }
}

#[test]
fn answers_without_a_grip_name_what_was_in_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // Boxes of so many millimetres.
    let solid = |name: &str, size: [f64; 3]| {
        let mut text = String::from("OFF\n8 12 0\n");
        for corner in 0..8 {
            let along = |axis: usize| size[axis] * f64::from(corner >> axis & 1);
            text += &format!("{} {} {}\n", along(0), along(1), along(2));
        }
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            text += &format!("3 {a} {b} {c}\n3 {a} {c} {d}\n");
        }
        std::fs::write(at.join(name), text).unwrap();
    };
    solid("near.off", [84.97, 90.0, 100.0]);
    solid("mid.off", [20.0, 30.0, 40.0]);
    let run = |line: &str, code: i32| {
        let output = gripfast(at, line);
        let told = text(&output.stdout) + &text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{line}: {told}");
        told
    };
    // A pair within the stroke, that no jaw can open beyond.
    let told = run("plan near.off -g robotiq-2f85 --mass 200g -q", 1);
    assert!(told.contains("(--min-opening)") && told.contains("84.97 x 90.0 x 100.0 mm"), "{told}");
    assert!(!told.contains("no two opposite faces lie within"), "{told}");
    // Faces that are no pair.
    let told = run("plan mid.off -g robotiq-2f85 --mass 200g -q --faces 0", 1);
    assert!(told.contains("no two of the faces chosen"), "{told}");
    assert!(!told.contains("within the stroke"), "{told}");
    let corner = "0mm,0mm,0mm:1mm,1mm,1mm";
    let told = run(&format!("plan mid.off -g generic --mass 20g --faces-in {corner}"), 2);
    assert!(told.contains("between (0, 0, 0) and (1, 1, 1) mm"), "{told}");
    // A light part has a mass, and no unit is said to be stated where none is.
    let told = run("plan mid.off -g generic --mass 0.01g -q --top 1 --spacing 20mm", 0);
    assert!(told.contains(" 0.0000100 kg,"), "{told}");
    let told = run("part mid.off", 0);
    assert!(told.contains("40.000 mm (the file states no unit: mm assumed)"), "{told}");
    let told = run("part mid.off --unit cm", 0);
    assert!(told.contains("400.000 mm (read in cm, as asked)"), "{told}");
    // Forces in pounds are not told to the last digit; the safety asked for is told everywhere.
    std::fs::write(
        at.join("pounds.toml"),
        "name = \"Pounds\"\nstroke = [\"0in\", \"4in\"]\nforce = [\"5lbf\", \"20lbf\"]\n\
         [pad]\nrectangle = [\"1in\", \"0.5in\"]\nfriction = 0.3\n",
    )
    .unwrap();
    let few = "--spacing 20mm --angle-step 90deg -q --safety 3 --top 1";
    let told = run(&format!("plan mid.off -g pounds.toml -g generic --mass 2kg {few}"), 0);
    assert!(told.contains("with which it holds with a safety of 3 under every load;"), "{told}");
    let told = run(&format!("plan mid.off -g pounds.toml --mass 8kg {few}"), 1);
    assert!(told.contains("Pounds at 88.964 N per jaw"), "{told}");
    assert!(told.contains("(the best of those solved needs"), "{told}");
    // A choice that leaves nothing is no success.
    let told = run(&format!("plan mid.off -g pounds.toml --mass 8kg {few} -o grips.json"), 1);
    assert!(told.contains("(the best needs"), "{told}");
    let told = run("export grips.json --holding -o grips.csv", 1);
    assert!(told.contains("warning: no grip is written"), "{told}");
}

#[test]
fn hints_about_the_unit_do_not_contradict_each_other() {
    let Some(battery) = crate::support::reference("trials/verdict/battery_in_metres.stl") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let line = format!("plan {} -g generic --mass 30g -q", battery.display());
    let err = text(&gripfast(folder.path(), &line).stderr);
    assert!(err.contains("(--unit m)") && !err.contains("--unit ft"), "{err}");
    assert!(err.contains("more than any metal"), "{err}");
}
