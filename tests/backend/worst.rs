//! The worst load under [`Polish::Worst`], where most loads are left out by bounds, against all
//! loads solved: grips on the parts that are shipped, under loads of every kind.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::DVec3;
use gripfast::backend::{Backend, Batch, Best, Polish, Problem, ScoreOptions, Scored, SeedSet};
use gripfast::gripper;
use gripfast::load::{LoadSet, LoadSource, wrench_in_grip};
use gripfast::model::{Grip, Wrench};
use gripfast::part::{MassProperties, Part, ReadOptions};
use gripfast::propose::{ProposeOptions, Proposer};

use crate::suite;

/// About this many grips of a part, evenly taken from all.
const GRIPS: usize = 12;

struct Case {
    grips: Vec<Grip>,
    mass: MassProperties,
}

impl Case {
    fn new(path: &Path, gripper: &str) -> Self {
        let part = Part::read(path, &ReadOptions::default()).unwrap();
        let gripper = gripper::find(gripper).unwrap();
        let options = ProposeOptions::default().with_spacing(Some(0.006));
        let all: Vec<Grip> = Proposer::new(&part, &gripper, &options)
            .unwrap()
            .flat_map(|chunk| chunk.grips)
            .collect();
        let step = (all.len() / GRIPS).max(1);
        let grips: Vec<Grip> = all.into_iter().step_by(step).collect();
        assert!(grips.len() >= 6, "{}: {} grips", path.display(), grips.len());
        Self { grips, mass: part.mass_properties(7850.0) }
    }

    /// Each load as each grip sees it.
    fn wrenches(&self, loads: &LoadSet) -> Vec<Vec<Wrench>> {
        let loads = loads.cases(&self.mass).unwrap();
        let centre = self.mass.centre_of_mass;
        let seen = |grip: &Grip| -> Vec<Wrench> {
            let pose = &grip.part_from_grip;
            loads.iter().map(|load| wrench_in_grip(&load.wrench, centre, pose)).collect()
        };
        self.grips.iter().map(seen).collect()
    }

    fn batch<'a>(&'a self, wrenches: &'a [Vec<Wrench>], force: f64) -> Batch<'a> {
        let problems = self.grips.iter().zip(wrenches).map(|(grip, wrenches)| Problem {
            contact: &grip.contact,
            distance: grip.distance(),
            force,
            wrenches,
            pose: None,
        });
        Batch { problems: problems.collect() }
    }

    fn score(
        &self,
        backend: &Backend,
        wrenches: &[Vec<Wrench>],
        force: f64,
        polish: Polish,
    ) -> Vec<Scored> {
        let options = ScoreOptions { polish, ..Default::default() };
        backend.score(&self.batch(wrenches, force), &SeedSet::default(), &options).unwrap()
    }

    /// In a race that none is out of.
    fn race(&self, wrenches: &[Vec<Wrench>], force: f64) -> Vec<Scored> {
        let (batch, set, options) =
            (self.batch(wrenches, force), SeedSet::default(), ScoreOptions::default());
        let mut best = Best::new(usize::MAX);
        Backend::Cpu.score_best(&batch, &set, &options, &mut best, &|_, mu| 1.0 / mu).unwrap()
    }

    /// Loads solved in full per grip that is held, and grips held: on the processor, and (where there
    /// is one) on a graphics processor.
    fn compare(&self, name: &str, loads: &LoadSet, force: f64) -> (f64, usize) {
        let wrenches = self.wrenches(loads);
        let expected = self.score(&Backend::Cpu, &wrenches, force, Polish::All);
        static GPU: OnceLock<Option<Backend>> = OnceLock::new();
        if let Some(gpu) = GPU.get_or_init(suite::gpu) {
            let found = self.score(gpu, &wrenches, force, Polish::Worst);
            assert_same(&format!("{name}, {force} N, graphics processor"), &found, &expected);
        }
        let raced = self.race(&wrenches, force);
        assert_same(&format!("{name}, {force} N, race"), &raced, &expected);
        let found = self.score(&Backend::Cpu, &wrenches, force, Polish::Worst);
        assert_same(&format!("{name}, {force} N, processor"), &found, &expected)
    }
}

/// Loads solved in full per grip that is held, and grips held; the answers are those where all loads
/// were.
fn assert_same(name: &str, found: &[Scored], expected: &[Scored]) -> (f64, usize) {
    let (mut held, mut solved, mut compared) = (0, 0, 0);
    for (index, (a, b)) in found.iter().zip(expected).enumerate() {
        let ((load, one), (expected, all)) = (a.worst.unwrap(), b.worst.unwrap());
        assert!(
            load == expected && one.status == all.status,
            "{name}, grip {index}: load {load} {one:?} instead of {expected} {all:?}"
        );
        assert_eq!(one.mu_s.is_some(), all.mu_s.is_some());
        if let (Some(one), Some(all)) = (one.mu_s, all.mu_s) {
            assert!((one / all - 1.0).abs() < 1e-9, "{name}, grip {index}: {one} {all}");
            held += 1;
            (solved, compared) = (solved + a.solved, compared + a.compared);
        }
    }
    let per = |count: usize| count as f64 / held.max(1) as f64;
    println!(
        "{name}: {held} of {} grips held; of {} loads {:.1} solved, {:.1} compared",
        found.len(),
        expected[0].all.len(),
        per(solved),
        per(compared)
    );
    (per(solved), held)
}

/// Loads of four kinds on a part of this mass.
fn load_sets(mass: f64) -> [(&'static str, LoadSet); 4] {
    let weight = 9.81 * mass;
    let ball = |directions, moment| LoadSource::Ball { directions, force: 2.0 * weight, moment };
    [
        ("gravity", LoadSet::new(vec![LoadSource::GravityAxes, LoadSource::GravitySphere(40)])),
        (
            "acceleration",
            LoadSet::new(vec![LoadSource::Gravity(DVec3::NEG_Z)]).with_acceleration(19.6),
        ),
        ("ball", LoadSet::new(vec![ball(120, None)])),
        ("ball with moments", LoadSet::new(vec![ball(60, Some(0.02 * weight))])),
    ]
}

fn shipped(part: &str) -> PathBuf {
    crate::support::root().join("data/parts").join(part)
}

fn worst_is_the_worst_of_all(path: &Path, gripper: &str) {
    let case = Case::new(path, gripper);
    let part = path.file_name().unwrap().display();
    let weight = 9.81 * case.mass.mass;
    let mut held = 0;
    for (name, loads) in load_sets(case.mass.mass) {
        // From pads pressed all over to pads about to be torn off.
        for force in [50.0, 12.0, 4.0] {
            held += case.compare(&format!("{part}, {name}"), &loads, force * weight).1;
        }
    }
    assert!(held > 40, "{held}");
}

macro_rules! parts {
    ($($name:ident: $part:expr, $gripper:expr;)+) => {
        $(#[test] fn $name() { worst_is_the_worst_of_all(&shipped($part), $gripper); })+
    };
}

macro_rules! reference_parts {
    ($($name:ident: $part:expr, $gripper:expr;)+) => {
        $(#[test] fn $name() {
            let path = crate::support::reference(concat!("parts/gen/gen_", $part, ".stl"));
            if let Some(path) = path {
                worst_is_the_worst_of_all(&path, $gripper);
            }
        })+
    };
}

parts! {
    bracket: "l_bracket.stl", "robotiq-2f85";
    pocket_plate: "pocket_plate.stl", "generic";
    nut: "hex_nut.stl", "generic";
    key: "shaft_key.stl", "franka-hand";
    gear: "spur_gear.stl", "robotiq-hande";
    bar: "t_slot_bar.stl", "wsg50-110";
}

reference_parts! {
    v_slot: "vslot_20x20_100", "robotiq-2f85";
    plate: "gantryplate_cbeam", "generic";
    angle: "lbracket_openbuilds", "generic";
    block: "pillowblock_cq", "robotiq-2f85";
}

#[test]
fn few_loads_of_many_accelerations_are_solved() {
    let case = Case::new(&shipped("l_bracket.stl"), "robotiq-2f85");
    let loads = LoadSet::new(vec![LoadSource::GravityAxes]).with_acceleration(19.6);
    let scale = case.mass.mass / 0.35;
    let (solved, held) = case.compare("bracket, accelerations", &loads, 235.0 * scale);
    // Near ties and loads about to lift a pad are solved.
    assert!(held == case.grips.len() && solved * 10.0 < 558.0, "{solved}");
}
