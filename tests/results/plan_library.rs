//! The main job as a call of the library: watched, stopped, resumed, and with what is in memory.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use gripfast::error::ErrorKind;
use gripfast::gripper;
use gripfast::part::{Part, ReadOptions};
use gripfast::plan::{Observer, Plan, Progress};
use gripfast::request::{Choice, Request};
use gripfast::results::{GripSet, RankedGrip};
use gripfast::units::{Angle, Length, Mass, Time};

fn request() -> Request {
    let part = crate::support::root().join("data/parts/t_slot_bar.stl");
    let mut request = Request::new(part, "generic");
    request.mass = Some(Mass(0.1));
    request.loads = vec!["gravity".into(), "ball:20:5N".into()];
    request.candidates.spacing = Some(Length(0.006));
    request.candidates.angle_step = Angle(45_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    request
}

/// Keeps all that it sees, and stops the run after some chunks.
#[derive(Default)]
struct Watch<'a> {
    progress: Vec<Progress>,
    grips: Vec<RankedGrip>,
    threads: Vec<usize>,
    notes: String,
    checkpoints: Vec<PathBuf>,
    stop: Option<&'a AtomicBool>,
}

impl Observer for Watch<'_> {
    fn progress(&mut self, progress: Progress) {
        self.progress.push(progress);
    }

    fn grips(&mut self, grips: &[RankedGrip]) {
        self.grips.extend_from_slice(grips);
        self.threads.push(rayon::current_num_threads());
        if let Some(stop) = self.stop {
            stop.store(true, Ordering::Relaxed);
        }
    }

    fn note(&mut self, text: &str) {
        self.notes += text;
    }

    fn checkpoint(&mut self, file: &Path) {
        self.checkpoints.push(file.to_owned());
    }
}

#[test]
fn an_observer_sees_every_grip_and_how_far_the_run_has_come() {
    let mut request = request();
    request.scoring.threads = Some(3);
    let plan = Plan::new(request).unwrap();
    let mut watch = Watch::default();
    let outcome = plan.run(&mut watch, &AtomicBool::new(false)).unwrap();
    let set = &outcome.set;
    assert!(set.provenance.complete && outcome.checkpoint.is_none());
    assert!(watch.threads.len() > 1 && watch.threads.iter().all(|&threads| threads == 3));
    assert!(watch.notes.starts_with("backend cpu"), "{}", watch.notes);
    let [first, .., last] = watch.progress[..] else { panic!("{:?}", watch.progress) };
    assert_eq!((first.done, first.total), (0, set.summary.candidates));
    assert_eq!((last.done, last.grips), (set.summary.candidates, set.summary.ranked));
    assert!(watch.progress.windows(2).all(|pair| pair[0].done < pair[1].done));
    let holds = |ranked: &&RankedGrip| ranked.worst.status.holds();
    assert_eq!(watch.grips.iter().filter(holds).count() as u64, set.summary.ranked);
    for ranked in &set.grips {
        let seen = watch.grips.iter().find(|seen| seen.grip.id == ranked.grip.id).unwrap();
        assert_eq!((seen.worst, &seen.grip), (ranked.worst, &ranked.grip));
    }
    let shown: Vec<u64> = outcome.shown().iter().map(|ranked| ranked.rank).collect();
    assert_eq!(shown, (1..=10).collect::<Vec<_>>());
    // Again, with nobody watching.
    assert_eq!(plan.run(&mut (), &AtomicBool::new(false)).unwrap(), outcome);
}

#[test]
fn a_stopped_run_says_so_and_is_resumed_to_the_same_grips() {
    let folder = tempfile::tempdir().unwrap();
    let whole = Plan::new(request()).unwrap().run(&mut (), &AtomicBool::new(false)).unwrap().set;
    let mut request = request();
    request.output.output = Some(folder.path().join("grips.json"));
    request.output.checkpoint = Time(0.0);
    request.output.resume = true;
    let plan = Plan::new(request).unwrap();
    let stop = AtomicBool::new(false);
    let mut watch = Watch { stop: Some(&stop), ..Watch::default() };
    let some = plan.run(&mut watch, &stop).unwrap();
    assert!(watch.notes.contains("nothing to resume from"), "{}", watch.notes);
    assert!(!some.set.provenance.complete);
    assert!(some.set.summary.candidates < whole.summary.candidates);
    let file = some.checkpoint.unwrap();
    assert!(file.exists() && watch.checkpoints.contains(&file));
    assert!(!folder.path().join("grips.json").exists());
    let partial = folder.path().join("grips.interrupted.json");
    assert!(!GripSet::read(&partial).unwrap().provenance.complete);

    let mut watch = Watch::default();
    let all = plan.run(&mut watch, &AtomicBool::new(false)).unwrap();
    assert!(watch.notes.contains("resuming from"), "{}", watch.notes);
    assert_eq!(watch.progress[0].done, some.set.summary.candidates);
    assert!(all.set.provenance.complete && all.checkpoint.is_none() && !file.exists());
    assert_eq!((&all.set.grips, &all.set.summary), (&whole.grips, &whole.summary));
}

/// A superellipsoid of 24 mm x 32 mm x 44 mm \[m\], whose contacts are hundreds of facets.
fn superellipsoid() -> Part {
    let (around, rows) = (48, 30);
    let half = DVec3::new(0.012, 0.016, 0.022);
    let at = |turn: f64, row: f64| {
        let rise = PI * ((row + 1.0) / f64::from(rows + 1) - 0.5);
        let ray = DVec3::new(rise.cos() * turn.cos(), rise.cos() * turn.sin(), rise.sin());
        let squares = ray * ray;
        half * ray / (squares * squares).element_sum().powf(0.25)
    };
    let ends = [-1.0, 1.0].map(|z| half * DVec3::Z * z);
    let (vertices, triangles) = crate::support::lathe::lathe(around, rows, ends, at);
    Part::from_triangles("superellipsoid", &vertices, &triangles).unwrap()
}

/// Stops the run as soon as it has come a way into the first chunk.
struct Halt<'a> {
    stop: &'a AtomicBool,
    seen: Vec<u64>,
}

impl Observer for Halt<'_> {
    fn progress(&mut self, progress: Progress) {
        self.seen.push(progress.done);
        self.stop.store(progress.done > 0, Ordering::Relaxed);
    }
}

#[test]
fn a_run_stopped_within_a_chunk_keeps_its_grips_and_scores_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = request();
    request.part = PathBuf::new();
    request.loads = vec!["gravity".into()];
    request.candidates.spacing = Some(Length(0.01));
    request.candidates.angle_step = Angle(90_f64.to_radians());
    request.output.output = Some(folder.path().join("grips.json"));
    request.output.resume = true;
    // Each grip of the file is asked for the force that it needs.
    request.selection.keep = Some(20);
    let part = superellipsoid();
    assert_eq!((part.faces.len(), part.curved.len()), (0, 1));
    let plan = Plan::builder(request).part(part).build().unwrap();
    let stop = AtomicBool::new(false);
    let mut halt = Halt { stop: &stop, seen: Vec::new() };
    let some = plan.run(&mut halt, &stop).unwrap();
    let summary = &some.set.summary;
    let [0, part] = halt.seen[..2] else { panic!("{:?}", halt.seen) };
    assert!(part > 0 && part < summary.candidates, "{:?}", halt.seen);
    assert!(!some.set.provenance.complete && !some.set.grips.is_empty());
    assert!(summary.rejections["interrupted"] > 0);
    let rejected: u64 = summary.rejections.values().sum();
    assert_eq!(summary.ranked + rejected, summary.candidates);

    let mut watch = Watch::default();
    let resumed = plan.run(&mut watch, &AtomicBool::new(false)).unwrap().set;
    assert!(watch.notes.contains("resuming from"), "{}", watch.notes);
    assert_eq!(watch.progress[0].done, 0);
    assert!(watch.progress.len() > 3, "{:?}", watch.progress);
    assert!(watch.progress.windows(2).all(|pair| pair[0].done < pair[1].done));
    std::fs::remove_file(folder.path().join("grips.json")).unwrap();
    let whole = plan.run(&mut (), &AtomicBool::new(false)).unwrap().set;
    assert_eq!((&resumed.grips, &resumed.summary), (&whole.grips, &whole.summary));
}

#[test]
fn part_gripper_and_loads_in_memory_are_as_good_as_those_of_files() {
    let from_files = Plan::new(request()).unwrap();
    let part = Part::read(&request().part, &ReadOptions::default()).unwrap();
    let mut nameless = request();
    (nameless.part, nameless.gripper) = (PathBuf::new(), "mine".into());
    nameless.loads.clear();
    let from_memory = Plan::builder(nameless)
        .part(part)
        .gripper(gripper::find("generic").unwrap())
        .loads(from_files.loads().to_vec())
        .command(vec!["a test".into()])
        .build()
        .unwrap();
    let run = |plan: &Plan| plan.run(&mut (), &AtomicBool::new(false)).unwrap().set;
    let (one, two) = (run(&from_files), run(&from_memory));
    assert!(!one.grips.is_empty());
    assert_eq!((&one.grips, &one.loads, &one.part), (&two.grips, &two.loads, &two.part));
    assert_eq!(two.provenance.command, ["a test"]);
}

#[test]
fn what_cannot_be_planned_is_refused_with_its_option() {
    let refused = |change: &dyn Fn(&mut Request)| {
        let mut request = request();
        change(&mut request);
        Plan::new(request).err().unwrap()
    };
    let error = refused(&|request| request.part = PathBuf::new());
    assert_eq!(error.place(), "part");
    let error = refused(&|request| request.part = "no/such/part.stl".into());
    assert_eq!(error.kind(), ErrorKind::NotFound);
    let error = refused(&|request| request.mass = None);
    assert_eq!(error.options(), ["mass", "density"]);
    let error = refused(&|request| request.force = "900N".parse().ok());
    assert!(error.options() == ["force"] && error.to_string().contains("10 N to 150 N"));
    let error = refused(&|request| request.loads.clear());
    assert_eq!(error.options(), ["loads"]);
    let error = refused(&|request| request.loads = vec!["bell:3".into()]);
    assert_eq!(error.options(), ["loads"]);
    let error = refused(&|request| request.output.output = Some("no/such/grips.json".into()));
    assert_eq!((error.kind(), error.options()), (ErrorKind::NotFound, &["output"][..]));
    let mut request = request();
    request.output.resume = true;
    let error = Plan::new(request).unwrap().run(&mut (), &AtomicBool::new(false)).err().unwrap();
    assert_eq!(error.options(), ["resume", "output"]);
}
