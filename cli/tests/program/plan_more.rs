//! `gripfast plan`: what it tells beside the ranking, and where it writes it.

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;
use glam::{DVec2, DVec3};
use gripfast::backend::{Backend, SeedSet};
use gripfast::export::Format;
use gripfast::geometry::patch_area;
use gripfast::gripper::{self, Gripper};
use gripfast::load::wrench_in_grip;
use gripfast::mechanics::{self, Options, Pads, solve_pads};
use gripfast::model::{Contact, Grip, Polygon, Ring, Score, Wrench};
use gripfast::part::{Part, ReadOptions, Unit};
use gripfast::plan::noise::Noise;
use gripfast::plan::{Assessor, Settings};
use gripfast::propose::{Displacement, ProposeOptions, Proposer};
use gripfast::results::{GripSet, LoadCase, RankedGrip};

const BRACKET: [&str; 10] = [
    "plan",
    "data/parts/l_bracket.stl",
    "--gripper",
    "robotiq-2f85",
    "--mass",
    "350g",
    "--backend",
    "cpu",
    "--angle-step",
    "90deg",
];

fn gripfast(arguments: &[&str]) -> Output {
    Command::cargo_bin("gripfast")
        .unwrap()
        .current_dir(crate::support::root())
        .args(arguments)
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A run on the bracket that must find grips: the set and what was printed.
fn bracket(more: &[&str]) -> (GripSet, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("grips.json");
    let output = gripfast(
        &[&BRACKET[..], &["--spacing", "8mm", "-o", file.to_str().unwrap()], more].concat(),
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the result and nothing else");
    (GripSet::read(&file).unwrap(), text(&output.stdout))
}

/// What refuses a grip hung on the order in which its loads were solved, which another depth of the
/// search changes.
#[test]
fn a_grip_is_refused_for_the_same_reason_in_a_table_and_in_a_file() {
    let rejected = |polish: &str| {
        let heavy = ["--mass", "12kg", "--force", "80N", "--accel", "1g", "--spacing", "12mm"];
        let line = ["plan", "data/parts/l_bracket.stl", "--gripper", "robotiq-2f85"];
        let output = gripfast(
            &[
                &line[..],
                &heavy,
                &["--backend", "cpu", "--angle-step", "90deg", "--polish", polish],
            ]
            .concat(),
        );
        assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
        let out = text(&output.stdout);
        out.lines().find(|line| line.starts_with("rejected")).unwrap().to_owned()
    };
    let table = rejected("top");
    assert!(table.contains("no normal force"), "{table}");
    assert_eq!(table, rejected("worst"));
}

#[test]
fn the_load_multiple_is_where_the_pads_friction_or_the_contact_ends() {
    let (set, out) = bracket(&["--accel", "2g", "--force", "20N", "--pad-friction", "1.1"]);
    assert!(out.contains("multiple"), "{out}");
    let friction = set.provenance.resolved.pad_friction.unwrap();
    assert_eq!(friction, 1.1);
    let (mut slipping, mut twisted, mut others, mut over) = (0, 0, 0, 0);
    for ranked in set.grips.iter().step_by(28) {
        let (multiple, needed) = (ranked.load_multiple.unwrap(), ranked.force_needed.unwrap());
        assert!((multiple * needed / 20.0 - 1.0).abs() < 1e-12);
        let pads = Pads::new(&ranked.grip.contact).unwrap();
        let (centre, frame) = (set.part.mass.centre_of_mass, &ranked.grip.part_from_grip);
        let at = |load: usize, factor: f64| {
            let wrench = wrench_in_grip(&set.loads[load].wrench, centre, frame);
            let grown = Wrench { force: wrench.force * factor, moment: wrench.moment * factor };
            solve_pads(&pads, ranked.grip.width, 20.0, &grown, &Options::default())
        };
        let held = |score: &Score| score.status.holds() && score.mu_s.unwrap() <= friction;
        for load in 0..set.loads.len() {
            let just = at(load, multiple * (1.0 - 1e-7));
            assert!(held(&just), "{}: load {load} at {multiple}: {just:?}", ranked.grip.id);
        }
        // Where the contact twists out first, the limit is found to 1e-4.
        let lost = |beyond: f64| -> Vec<(usize, bool)> {
            let all = (0..set.loads.len()).map(|load| (load, at(load, multiple * (1.0 + beyond))));
            let lost = all.filter(|(_, score)| !held(score));
            lost.map(|(load, score)| (load, score.mu_s.is_some())).collect()
        };
        let mut lost_loads = lost(1e-6);
        if lost_loads.is_empty() {
            lost_loads = lost(1.01e-4);
        }
        let slips = lost_loads.iter().any(|(_, slips)| *slips);
        let lost: Vec<usize> = lost_loads.into_iter().map(|(load, _)| load).collect();
        // Of the loads other than the worst only the states count that they come to as they grow.
        let worst = ranked.worst.load as usize;
        over += usize::from(lost.is_empty());
        others += usize::from(!lost.is_empty() && !lost.contains(&worst));
        slipping += usize::from(slips);
        twisted += usize::from(!slips && !lost.is_empty());
        // The safety is the friction's share alone: equal where mu_s grows with the load up to
        // there.
        let whole = at(worst, multiple * (1.0 - 1e-7)).contact_area_i;
        if whole == patch_area(&ranked.grip.contact.face_i)
            && lost.contains(&worst)
            && slips
            && ranked.contact_share == 1.0
        {
            assert!((multiple / ranked.safety.unwrap() - 1.0).abs() < 1e-6, "{}", ranked.grip.id);
        }
    }
    let kinds = format!("{slipping} {twisted}, {others} by another load, {over} told too much");
    assert!(slipping > 3 && twisted > 3 && others > 3, "{kinds}");
    assert!(20 * over <= slipping + twisted, "{kinds}");
}

#[test]
fn compare_puts_the_earlier_method_beside_every_grip() {
    let (set, out) = bracket(&["--compare"]);
    let comparison = set.summary.comparison.as_ref().unwrap();
    assert_eq!(comparison.grips, set.grips.len() as u64);
    let earlier = |ranked: &RankedGrip| ranked.earlier.clone().unwrap();
    // Places follow the evaluations, and ties share.
    for a in set.grips.iter().step_by(5) {
        let (mut better, mut same) = (0.0, 0.0);
        for b in &set.grips {
            let (x, y) = (earlier(a).evaluation, earlier(b).evaluation);
            if (x - y).abs() <= 1e-9 * x.abs() {
                same += 1.0;
            } else if y > x {
                better += 1.0;
            }
        }
        assert_eq!(earlier(a).place, better + (same + 1.0) / 2.0, "{}", a.grip.id);
    }
    // Pearson's correlation of the places, those by score counted out as well.
    // Scores tie neighbour by neighbour, as in the ranking.
    let mut scores: Vec<f64> = set.grips.iter().map(|a| a.score.unwrap()).collect();
    scores.sort_by(|a, b| b.total_cmp(a));
    let by_score = |a: &RankedGrip| {
        let mut better = 0;
        for run in scores.chunk_by(|a, b| a - b <= 1e-9 * a) {
            if run.contains(&a.score.unwrap()) {
                return better as f64 + (run.len() as f64 + 1.0) / 2.0;
            }
            better += run.len();
        }
        panic!("a score that no grip has");
    };
    let pairs: Vec<(f64, f64)> =
        set.grips.iter().map(|a| (by_score(a), earlier(a).place)).collect();
    let mean = (set.grips.len() as f64 + 1.0) / 2.0;
    let sum = |f: &dyn Fn(f64, f64) -> f64| {
        pairs.iter().map(|&(x, y)| f(x - mean, y - mean)).sum::<f64>()
    };
    let expected = sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt();
    assert!(
        (comparison.spearman.unwrap() - expected).abs() < 1e-12,
        "{:?} {expected}",
        comparison.spearman
    );
    assert!(comparison.kendall_tau_b.is_some_and(|tau| tau.abs() < 1.0 && tau * expected > 0.0));
    let gain = |id: u64| {
        set.grips
            .iter()
            .zip(&pairs)
            .find(|(ranked, _)| ranked.grip.id == id)
            .map(|(_, (now, before))| before - now)
            .unwrap()
    };
    let most = pairs.iter().map(|(now, before)| before - now).fold(0.0, f64::max);
    assert_eq!(gain(comparison.risen[0]), most);
    assert!(comparison.fallen.iter().all(|&id| gain(id) < 0.0));
    for needle in
        ["Spearman", "Kendall tau-b", "ranked higher than by the earlier method", "earlier mu_s"]
    {
        assert!(out.contains(needle), "{needle}: {out}");
    }
    let (plain, out) = bracket(&[]);
    assert!(
        plain.summary.comparison.is_none()
            && plain.grips.iter().all(|ranked| ranked.earlier.is_none())
            && !out.contains("arlier")
    );
}

#[test]
fn pose_noise_is_told_for_the_printed_grips_and_does_not_depend_on_threads() {
    let noise = ["--pose-noise", "1mm,2deg", "--noise-samples", "20", "--top", "4"];
    let (one, out) = bracket(&[&noise[..], &["--threads", "1"]].concat());
    let (two, _) = bracket(&[&noise[..], &["--threads", "2"]].concat());
    assert_eq!(one.grips, two.grips);
    assert!(out.contains("noise 95 %") && out.contains("20 poses off by up to 1 mm"), "{out}");
    assert!(
        one.grips[..4]
            .iter()
            .all(|ranked| ranked.pose_noise.is_some_and(|noise| noise.samples == 20))
    );
    assert!(one.grips[4..].iter().all(|ranked| ranked.pose_noise.is_none()));
    let (diverse, _) = bracket(&[&noise[..], &["--diverse"]].concat());
    let with: Vec<u64> = diverse
        .grips
        .iter()
        .filter(|ranked| ranked.pose_noise.is_some())
        .map(|ranked| ranked.rank)
        .collect();
    assert!(with.len() == 4 && with[3] > 4, "{with:?}");
    // Without noise every pose is the pose.
    let (still, _) = bracket(&["--pose-noise", "0mm,0deg", "--noise-samples", "3", "--top", "4"]);
    for ranked in &still.grips[..4] {
        let noise = ranked.pose_noise.unwrap();
        let mu = ranked.worst.mu_s.unwrap();
        assert!(
            noise.lost == 0
                && (noise.mu_s_worst.unwrap() / mu - 1.0).abs() < 1e-9
                && noise.mu_s_95 == noise.mu_s_worst,
            "{noise:?} {mu}"
        );
    }
}

/// A box of this size [m] with a corner at the origin, as STL.
fn write_box(file: &Path, size: DVec3) {
    let corner = |index: usize| {
        DVec3::new(
            f64::from(u8::from(index & 1 > 0)),
            f64::from(u8::from(index & 2 > 0)),
            f64::from(u8::from(index & 4 > 0)),
        ) * size
    };
    let mut stl = "solid box\n".to_owned();
    for [a, b, c, d] in
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    {
        for triangle in [[a, b, c], [a, c, d]] {
            stl += "facet normal 0 0 0\nouter loop\n";
            for point in triangle.map(corner) {
                stl += &format!("vertex {} {} {}\n", point.x, point.y, point.z);
            }
            stl += "endloop\nendfacet\n";
        }
    }
    std::fs::write(file, stl + "endsolid box\n").unwrap();
}

/// What lies left of each edge of the convex `window` (Sutherland and Hodgman 1974).
fn clipped(mut ring: Ring, window: &[DVec2]) -> Ring {
    for (index, &a) in window.iter().enumerate() {
        let edge = window[(index + 1) % window.len()] - a;
        let side = |point: DVec2| edge.perp_dot(point - a);
        let mut left = Ring::new();
        for (index, &p) in ring.iter().enumerate() {
            let q = ring[(index + 1) % ring.len()];
            if side(p) >= 0.0 {
                left.push(p);
            }
            if (side(p) >= 0.0) != (side(q) >= 0.0) {
                left.push(p + (q - p) * (side(p) / (side(p) - side(q))));
            }
        }
        ring = left;
    }
    ring
}

/// A box of 80 x 60 x 20 mm and the grips on it across its 20 mm.
fn box_and_grips(folder: &Path, gripper: &Gripper) -> (Part, ProposeOptions, Vec<Grip>) {
    let file = folder.join("box.stl");
    write_box(&file, DVec3::new(80.0, 60.0, 20.0));
    let part = Part::read(
        &file,
        &ReadOptions::default()
            .with_unit(Some(Unit::ALL.into_iter().find(|unit| unit.metres() == 1e-3).unwrap())),
    )
    .unwrap();
    let options = ProposeOptions::default().with_angle_step(0.5).with_spacing(Some(0.004));
    let grips: Vec<Grip> = Proposer::new(&part, gripper, &options)
        .unwrap()
        .flat_map(|chunk| chunk.grips)
        .filter(|grip| grip.width < 0.021)
        .collect();
    assert!(grips.len() > 50, "{}", grips.len());
    (part, options, grips)
}

#[test]
fn displaced_grips_agree_with_pads_clipped_by_hand() {
    let folder = tempfile::tempdir().unwrap();
    let gripper = gripper::find("generic").unwrap();
    let (part, options, grips) = box_and_grips(folder.path(), &gripper);
    let proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let pad_area = patch_area(&[Polygon { outer: gripper.pad.clone(), holes: Vec::new() }]);
    let noise = Noise { shift: 0.004, turn: 0.1, samples: 40 };
    let by = noise.displacements();
    assert!(by.iter().all(|by| by.shift.abs().max_element() <= 0.004 && by.turn.abs() <= 0.1));

    // The middle of the large face: the whole pad stays on it, wherever it goes.
    let middle = DVec3::new(0.04, 0.03, 0.01);
    let from_middle = |grip: &&Grip| grip.part_from_grip.origin.distance(middle);
    let inner = grips.iter().min_by(|a, b| from_middle(a).total_cmp(&from_middle(b))).unwrap();
    let reach = gripper.pad.iter().map(|point| point.length()).fold(0.0, f64::max);
    assert!(reach + 0.006 + from_middle(&inner) < 0.03, "the pad fits the face");
    for grip in proposer.displaced(inner, &by).unwrap() {
        let area = patch_area(&grip.contact.face_i);
        assert!((area / pad_area - 1.0).abs() < 1e-12, "{area}");
    }

    // At an edge: each displaced contact, its load and its mu_s by hand.
    let part_of_pad = |grip: &&Grip| {
        patch_area(&grip.contact.face_i) < 0.8 * pad_area
            && grip.part_from_grip.rotation.x_axis.x.abs() > 0.1
    };
    let edge: Vec<&Grip> = grips.iter().filter(part_of_pad).step_by(9).take(4).collect();
    assert_eq!(edge.len(), 4);
    let mass = part.mass_properties(2700.0);
    let loads: Vec<LoadCase> =
        [DVec3::new(0.0, 0.0, -1.0), DVec3::new(1.0, -3.0, 0.5), DVec3::new(-2.0, 0.0, 1.0)]
            .map(|force| LoadCase {
                name: "by hand".into(),
                wrench: Wrench { force, moment: DVec3::new(0.01, 0.0, -0.02) },
            })
            .to_vec();
    let settings = Settings::of_force(40.0);
    let seeds = SeedSet::with_at_least(81).unwrap();
    let assessor = Assessor {
        loads: &loads,
        mass,
        settings: &settings,
        backend: &Backend::Cpu,
        seeds: &seeds,
    };
    let mut ranked = assessor.assess(edge.iter().map(|&grip| grip.clone()).collect()).unwrap();
    noise.assess(&proposer, &assessor, &mut ranked.iter_mut().collect::<Vec<_>>()).unwrap();
    let mut lost_in_all = 0;
    for (grip, ranked) in edge.iter().zip(&ranked) {
        let mut values = Vec::new();
        for (by, displaced) in by.iter().zip(proposer.displaced(grip, &by).unwrap()) {
            let pose = by_hand(grip, by);
            let face: Ring = [(0.0, 0.0), (0.08, 0.0), (0.08, 0.06), (0.0, 0.06)]
                .map(|(x, y)| pose.inverse_point(DVec3::new(x, y, pose.origin.z)))
                .to_vec();
            let sense = face[0].perp_dot(face[1])
                + face[1].perp_dot(face[2])
                + face[2].perp_dot(face[3])
                + face[3].perp_dot(face[0]);
            let face: Ring = if sense < 0.0 { face.into_iter().rev().collect() } else { face };
            let patch =
                vec![Polygon { outer: clipped(gripper.pad.clone(), &face), holes: Vec::new() }];
            let area = patch_area(&displaced.contact.face_i);
            assert!(
                (area - patch_area(&patch)).abs() < 1e-8 * pad_area,
                "{area} {}",
                patch_area(&patch)
            );
            let contact = Contact { face_i: patch.clone(), face_ii: patch };
            let mu = |load: &LoadCase| {
                let arm = mass.centre_of_mass - pose.origin;
                let force = load.wrench.force;
                let moment = load.wrench.moment + arm.cross(force);
                let into = |v: DVec3| {
                    DVec3::new(v.dot(pose.axes[0]), v.dot(pose.axes[1]), v.dot(pose.axes[2]))
                };
                let score = mechanics::solve(
                    &contact,
                    0.02,
                    40.0,
                    &Wrench { force: into(force), moment: into(moment) },
                    &Options::default(),
                )
                .unwrap();
                score.mu_s.filter(|_| score.status.holds()).unwrap_or(f64::INFINITY)
            };
            values.push(loads.iter().map(mu).fold(0.0, f64::max));
        }
        values.sort_by(f64::total_cmp);
        let found = ranked.pose_noise.unwrap();
        let lost = values.iter().filter(|mu| mu.is_infinite()).count();
        assert_eq!((found.samples, found.lost as usize), (40, lost));
        lost_in_all += lost;
        for (found, expected) in [(found.mu_s_95, values[37]), (found.mu_s_worst, values[39])] {
            match found {
                Some(found) => assert!((found / expected - 1.0).abs() < 1e-6, "{found} {expected}"),
                None => assert!(expected.is_infinite(), "{expected}"),
            }
        }
        assert!(values[39] > ranked.worst.mu_s.unwrap() * 1.01, "some pose is worse");
    }
    assert!(lost_in_all < 160, "not all are lost");
    // Beside the part there is no contact, and the grip is lost.
    let away = Displacement { shift: DVec2::new(0.2, 0.0), turn: 0.3 };
    let gone = proposer.displaced(edge[0], &[away]).unwrap();
    assert_eq!(patch_area(&gone[0].contact.face_i), 0.0);
    assert!(!assessor.assess(gone).unwrap()[0].worst.status.holds());
}

/// A displaced frame worked out without the library's.
struct Pose {
    axes: [DVec3; 3],
    origin: DVec3,
}

impl Pose {
    fn inverse_point(&self, point: DVec3) -> DVec2 {
        let arm = point - self.origin;
        DVec2::new(arm.dot(self.axes[0]), arm.dot(self.axes[1]))
    }
}

fn by_hand(grip: &Grip, by: &Displacement) -> Pose {
    let [x1, x2, x3] = [0, 1, 2].map(|axis| grip.part_from_grip.rotation.col(axis));
    let (sin, cos) = by.turn.sin_cos();
    Pose {
        axes: [cos * x1 + sin * x2, cos * x2 - sin * x1, x3],
        origin: grip.part_from_grip.origin + by.shift.x * x1 + by.shift.y * x2,
    }
}

#[test]
fn the_ending_of_the_result_chooses_its_format() {
    let folder = tempfile::tempdir().unwrap();
    let base = [
        &BRACKET[..],
        &[
            "--spacing",
            "20mm",
            "-q",
            "--top",
            "3",
            "--compare",
            "--pose-noise",
            "1mm,1deg",
            "--noise-samples",
            "5",
        ],
    ]
    .concat();
    let built = |format: Format| {
        (format != Format::Parquet || cfg!(feature = "parquet"))
            && (format != Format::Acronym || cfg!(feature = "hdf5"))
    };
    for (format, _, endings) in Format::ALL {
        let file = folder.path().join(format!("grips{}", endings[0]));
        let output = gripfast(&[&base[..], &["-o", file.to_str().unwrap()]].concat());
        let err = text(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(if built(format) { 0 } else { 2 }),
            "{format:?}: {err}"
        );
        assert_eq!(file.exists(), built(format), "{format:?}");
    }
    let csv = std::fs::read_to_string(folder.path().join("grips.csv")).unwrap();
    let (head, first) = (csv.lines().next().unwrap(), csv.lines().nth(1).unwrap());
    for column in [
        "load_multiple",
        "noise_mu_s_95",
        "noise_lost_share",
        "earlier_evaluation",
        "earlier_place",
    ] {
        assert!(head.split(',').any(|name| name == column), "{column}: {head}");
    }
    assert!(!first.ends_with(','), "{first}");
    let lines = GripSet::read(&folder.path().join("grips.jsonl")).unwrap();
    assert!(lines.summary.comparison.is_some() && lines.grips[0].pose_noise.is_some());
    // A name without an ending is native JSON.
    let bare = folder.path().join("grips");
    assert_eq!(
        gripfast(&[&base[..], &["-o", bare.to_str().unwrap()]].concat()).status.code(),
        Some(0)
    );
    assert_eq!(GripSet::read(&bare).unwrap().grips, lines.grips);
}

#[test]
fn what_cannot_be_is_refused_before_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (more, needle) in [
        (vec!["-o", &at("grips.xls")], ".csv"),
        (vec!["-o", &at("grips.yaml")], ".moveit.yaml"),
        (vec!["-o", &at("no/such/grips.json")], "no/such"),
        (vec!["-o", "-"], "--json"),
        (vec!["--pose-noise", "1mm"], "1mm,2deg"),
        (vec!["--pose-noise", "1,2deg"], "no unit"),
        (vec!["--pose-noise", "1mm,2mm"], "deg"),
        (vec!["--pose-noise=-1mm,2deg"], "negative"),
        (vec!["--pose-noise", "1mm,2deg", "--noise-samples", "0"], "--noise-samples"),
        (vec!["--noise-samples", "8"], "--pose-noise"),
        (vec!["--compare=1,2"], "K1,K2,K3,EPSILON"),
        (vec!["--compare=1,2,3,0mm"], "above zero"),
        (vec!["--compare=1,-2,3,1mm"], "zero or more"),
        (vec!["--resume"], "--output"),
        (vec!["--resume", "-o", "/dev/null"], "regular file"),
        (vec!["--checkpoint", "30", "-o", &at("grips.json")], "no unit"),
        (vec!["--checkpoint=-3s", "-o", &at("grips.json")], "--checkpoint"),
    ] {
        let output = gripfast(&[&BRACKET[..], &["--spacing", "15mm"], &more].concat());
        let err = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{more:?}: {err}");
        assert!(err.contains(needle) && !err.contains("panicked"), "{more:?}: {err}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
