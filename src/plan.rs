//! The main job: from a part, a gripper and loads to a ranked list of grips.
//!
//! A [`Plan`] is made from a [`Request`]: it reads the part, the gripper and the loads.
//! [`Plan::run`] proposes candidates chunk by chunk, scores them under every load and keeps the
//! best; an [`Observer`] sees what it finds on the way, a flag stops it, and the state in a file
//! beside the result lets a later run resume it. All of it runs on threads of its own.
//!
//! ```
//! use std::sync::atomic::AtomicBool;
//!
//! use gripfast::plan::Plan;
//! use gripfast::request::{Choice, Request};
//! use gripfast::units::{Angle, Length, Mass};
//!
//! let mut request = Request::new("data/parts/hex_nut.stl", "generic");
//! request.mass = Some(Mass(0.02));
//! request.candidates.spacing = Some(Length(0.006));
//! request.candidates.angle_step = Angle(1.6);
//! request.scoring.backend = Choice::Cpu;
//! let plan = Plan::new(request)?;
//! let outcome = plan.run(&mut (), &AtomicBool::new(false))?;
//! assert!(outcome.set.grips[0].worst.mu_s.is_some());
//! # Ok::<(), gripfast::error::Error>(())
//! ```

mod ahead;
mod assess;
mod cause;
pub mod checkpoint;
mod collect;
mod limits;
mod needed;
mod negatives;
pub mod noise;
mod output;
mod outside;
mod prepare;
mod search;
mod share;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use glam::{DVec2, DVec3};
use rayon::ThreadPool;

use crate::backend::{Backend, SeedSet, Selection, select};
use crate::error::{Error, Result};
use crate::export::Format;
use crate::file::Lock;
use crate::gripper::{Gripper, Jaws};
use crate::lab::compare;
use crate::model::Negative;
use crate::part::{MassProperties, Part, Symmetry};
use crate::propose::{Explanation, ProposeOptions, Proposer};
use crate::rank;
use crate::request::{Choice, KEEP, Polish, Request};
use crate::results::{GripSet, LoadCase, PartSummary, Provenance, RankedGrip, Resolved, Summary};
use crate::units::{Force, Length};
use noise::Noise;
use search::{Found, Partial, Search};

pub use ahead::Ahead;
pub use assess::{Assessor, Settings};
pub use collect::{Collector, OUTRANKED};
pub use limits::Limits;
pub use negatives::near_misses;
pub use output::{GLB_TOP, WHOLE, solve_every_load};
pub use outside::{Assessed, Assessment, Standing, explain};
pub use prepare::{PlanBuilder, most_threads};

/// The main job, ready to run.
#[derive(Debug)]
pub struct Plan {
    request: Request,
    /// As the request said, before `auto` became one of the others.
    asked_polish: Polish,
    part: Part,
    gripper: Gripper,
    mass: MassProperties,
    /// Turns that map the part to itself.
    symmetry: Option<Symmetry>,
    loads: Vec<LoadCase>,
    propose: ProposeOptions,
    settings: Settings,
    seeds: SeedSet,
    /// Of the result file.
    format: Option<Format>,
    command: Vec<String>,
    warnings: Vec<String>,
    /// Whether nobody looks at the grips that are not shown.
    shown_only: bool,
    threads: ThreadPool,
}

/// How far a run has come.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Progress {
    /// Candidates looked at so far, those of the run that it resumes included.
    pub done: u64,
    /// Candidates in all.
    pub total: u64,
    /// Grips with a limit state so far.
    pub grips: u64,
}

/// Sees a run while it goes; every method does nothing unless it is overridden, and `()` sees
/// nothing at all.
pub trait Observer: Send {
    /// Now and then, and once before the first candidate.
    fn progress(&mut self, _progress: Progress) {}

    /// The search is over: the numbers that only listed grips have are made now, and so many of all have
    /// them.
    fn finishing(&mut self, _done: usize, _grips: usize) {}

    /// The grips of a chunk in the order of their ids, each with its worst load solved, also those
    /// that do not hold ([`crate::model::Status::holds`]). Their ranks are not known yet.
    fn grips(&mut self, _grips: &[RankedGrip]) {}

    /// Something good to know, such as the backend in use.
    fn note(&mut self, _text: &str) {}

    /// Something to look at before relying on the result.
    fn warning(&mut self, _text: &str) {}

    /// The state of the run was written to this file.
    fn checkpoint(&mut self, _file: &Path) {}
}

impl Observer for () {}

/// What a run came to.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Outcome {
    /// The ranked grips with all that is known of them, as in the result file.
    pub set: GripSet,
    /// Ids of the grips to show, best first: the first ones, or those that differ.
    pub shown: Vec<u64>,
    /// The file from which the run can be resumed, where it was interrupted.
    pub checkpoint: Option<PathBuf>,
    /// The files written. An interrupted run writes under names of their own
    /// (`grips.interrupted.json` for `grips.json`): an older result stays.
    pub written: Vec<PathBuf>,
}

impl Outcome {
    /// The grips to show, best first.
    pub fn shown(&self) -> Vec<&RankedGrip> {
        self.set.grips.iter().filter(|ranked| self.shown.contains(&ranked.grip.id)).collect()
    }
}

impl Plan {
    /// Reads the part, the gripper and the loads that a request names.
    ///
    /// # Errors
    /// When one of them cannot be read, or an option is out of its range.
    pub fn new(request: Request) -> Result<Self> {
        Self::builder(request).build()
    }

    /// As [`Plan::new`], with a part, a gripper or loads that are already in memory.
    pub fn builder(request: Request) -> PlanBuilder {
        PlanBuilder::new(request)
    }

    /// What was asked for.
    pub fn request(&self) -> &Request {
        &self.request
    }

    /// The part.
    pub fn part(&self) -> &Part {
        &self.part
    }

    /// Its mass properties.
    pub fn mass(&self) -> &MassProperties {
        &self.mass
    }

    /// The gripper.
    pub fn gripper(&self) -> &Gripper {
        &self.gripper
    }

    /// The load cases, in the part frame about the centre of mass.
    pub fn loads(&self) -> &[LoadCase] {
        &self.loads
    }

    /// What a user should know of the part before relying on the numbers.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Why a pose is a grip, or is not: `position` \[m\] and approach angle \[rad\] in the plane of the
    /// face pair of this number.
    ///
    /// # Errors
    /// As [`Proposer::new`] and [`Proposer::explain`].
    pub fn explain(&self, site: usize, position: DVec2, angle: f64) -> Result<Explanation> {
        self.threads.install(|| {
            Proposer::new(&self.part, &self.gripper, &self.propose)?.explain(
                site,
                position,
                angle,
                Jaws::Straight,
            )
        })
    }

    /// The number of a face pair in the plan, given by the numbers of its faces: with several
    /// stretches, that of the largest.
    ///
    /// # Errors
    /// When the gripper cannot grip these faces, and as [`Proposer::new`].
    pub fn site_of(&self, face_i: u32, face_ii: u32) -> Result<usize> {
        let proposer = Proposer::new(&self.part, &self.gripper, &self.propose)?;
        let sites = proposer.sites();
        let holds = |site: &crate::propose::SiteInfo| {
            let has = |faces: [u32; 2]| {
                site.faces_i.contains(&faces[0]) && site.faces_ii.contains(&faces[1])
            };
            has([face_i, face_ii]) || has([face_ii, face_i])
        };
        sites.iter().position(holds).ok_or_else(|| {
            Error::input(
                format!("faces {face_i} and {face_ii}"),
                "are no pair that this gripper can grip on this part",
                "see the pairs and widths that `gripfast part` lists, and the gripper's stroke",
            )
        })
    }

    /// Finds and ranks the grips, and writes the files that the request names. When `stop` becomes
    /// true, the run ends after the chunk in flight with what it has.
    ///
    /// The grips, their numbers and their order depend neither on the number of threads nor on the
    /// backend nor on interruptions.
    ///
    /// # Errors
    /// When no backend is there, an option does not fit the part, the state to resume belongs to
    /// another request, or a file cannot be written.
    pub fn run(&self, observer: &mut dyn Observer, stop: &AtomicBool) -> Result<Outcome> {
        self.threads.install(|| self.run_here(observer, stop))
    }

    fn run_here(&self, observer: &mut dyn Observer, stop: &AtomicBool) -> Result<Outcome> {
        self.warnings.iter().for_each(|text| observer.warning(text));
        if let Some(outcome) = self.finished(observer)? {
            return Ok(outcome);
        }
        let scoring = &self.request.scoring;
        let selection = self.select_backend()?;
        // Of a machine without a graphics processor there is nothing to say.
        if scoring.backend != Choice::Auto || !matches!(selection.backend, Backend::Cpu) {
            observer.note(&format!("backend {}", selection.reason));
        }
        let assessor = self.assessor(&selection.backend);
        let mut proposer = Proposer::new(&self.part, &self.gripper, &self.propose)?;
        let output = self.request.output.output.as_deref();
        let _held = output.map(Lock::take).transpose()?;
        let partial = self.partial()?;
        let search = self.search(&assessor, partial.as_ref());
        let found = search.run(&mut proposer, observer, stop)?;
        let mut outcome = self.conclude(&proposer, &assessor, found, observer, stop)?;
        if let Some(partial) = partial {
            if outcome.set.provenance.complete {
                partial.remove()?;
            } else if outcome.checkpoint.is_none() {
                outcome.checkpoint = partial.is_there().then(|| partial.path.clone());
            }
        }
        Ok(outcome)
    }

    fn select_backend(&self) -> Result<Selection> {
        let scoring = &self.request.scoring;
        select(scoring.backend, scoring.adapter.as_deref())
    }

    fn search<'a>(
        &'a self,
        assessor: &'a Assessor<'a>,
        partial: Option<&'a Partial>,
    ) -> Search<'a> {
        Search {
            assessor,
            keep: self.keep(),
            race: self.request.scoring.polish == Polish::Top,
            ids: self.request.selection.ids.as_deref(),
            flips: self.propose.flips,
            sample: self.sample(),
            partial,
            resume: self.request.output.resume,
        }
    }

    /// From what was found to the ranked grips and the files.
    fn conclude(
        &self,
        proposer: &Proposer<'_>,
        assessor: &Assessor<'_>,
        mut found: Found,
        observer: &mut dyn Observer,
        stop: &AtomicBool,
    ) -> Result<Outcome> {
        for remark in proposer.tally().remarks(&self.gripper, &self.propose) {
            observer.note(&remark);
        }
        let checkpoint = found.checkpoint.clone();
        let lost = found.collector.take_lost();
        let misses = self.misses(proposer, &lost);
        let none = found.complete && found.collector.is_empty();
        let nearest = none.then(|| self.nearest_lost(proposer, &lost)).flatten();
        let (set, shown) = self.finish(proposer, assessor, found, lost, observer, stop)?;
        let complete = set.provenance.complete;
        if complete && set.grips.is_empty() {
            let rejections = &set.summary.rejections;
            let tally = proposer.tally();
            let causes = cause::causes(&self.part, &self.gripper, &self.propose, tally, rejections);
            causes.iter().for_each(|cause| observer.note(cause));
            nearest.iter().for_each(|text| observer.note(text));
            if let Some(cause) = cause::overpowered(&self.loads, self.settings.force, rejections) {
                observer.note(&cause);
            }
        }
        let asked = self.request.selection.ids.as_deref().unwrap_or_default();
        if complete && let Some(text) = cause::no_grips(asked, &set) {
            observer.warning(&text);
        }
        let written = self.write(&set, complete, &misses)?;
        Ok(Outcome { set, shown, checkpoint, written })
    }

    fn assessor<'a>(&'a self, backend: &'a Backend) -> Assessor<'a> {
        Assessor {
            loads: &self.loads,
            mass: self.mass,
            settings: &self.settings,
            backend,
            seeds: &self.seeds,
        }
    }

    /// Orders what was found and adds what only the grips of the list need; the ids of those to
    /// show. `lost`: grips that do not hold, by reason. After `stop` only those to show have all numbers,
    /// and the list is not complete.
    fn finish(
        &self,
        proposer: &Proposer<'_>,
        assessor: &Assessor<'_>,
        found: Found,
        lost: BTreeMap<String, Vec<Negative>>,
        observer: &mut dyn Observer,
        stop: &AtomicBool,
    ) -> Result<(GripSet, Vec<u64>)> {
        let selection = &self.request.selection;
        let (low, high) = self.part.mesh.bounding_box();
        let (centre, size) = (self.mass.centre_of_mass, (high - low).length());
        let negatives = if found.complete { self.negatives(proposer, lost) } else { Vec::new() };
        let ranking = found.collector.finish(centre, size, &self.rank_options());
        let mut rejections = proposer.tally().rejections.clone();
        for (reason, count) in &ranking.rejections {
            *rejections.entry(reason.clone()).or_default() += count;
        }
        let mut grips = self.kept(ranking.grips, size);
        let shown = self.shown(&grips, size);
        // Where none holds the least force of all is told.
        let others = !self.shown_only || ranking.holding == 0;
        let count = if others { grips.len() } else { shown.len() };
        let mut told = |done: usize| observer.finishing(done, count);
        let left = assessor.finish_until(&mut grips, (&shown, others), stop, &mut told)?;
        if left > 0 {
            observer.warning(&format!(
                "interrupted: {left} of {count} grips have no force needed and no multiple"
            ));
        }
        let complete = found.complete && left == 0;
        let comparison = selection
            .compare
            .map(|weights| compare::compare(&mut grips, centre, self.settings.force, &weights));
        self.add_noise(proposer, assessor, &mut grips, &shown)?;
        self.solve_other_loads(assessor, &mut grips, &shown)?;
        let mut set = GripSet::new(
            self.provenance(found.backend, complete),
            self.part_summary([low, high]),
            output::gripper_json(&self.gripper)?,
            self.loads.clone(),
        );
        set.summary = Summary {
            pairs: proposer.tally().pairs,
            candidates: proposer.tally().candidates,
            ranked: ranking.ranked,
            holding: self.settings.pads.value.map(|_| ranking.holding),
            rejections,
            comparison,
        };
        (set.negatives, set.grips) = (negatives, grips);
        Ok((set, shown))
    }

    /// What a finished run of the same request has left, where this one resumes it.
    fn finished(&self, observer: &mut dyn Observer) -> Result<Option<Outcome>> {
        let output = &self.request.output;
        let native = matches!(self.format, Some(Format::Json | Format::JsonLines));
        let is_there = |path: &&Path| native && output.resume && path.is_file();
        let Some(path) = output.output.as_deref().filter(is_there) else { return Ok(None) };
        if self.partial()?.is_some_and(|partial| partial.is_there()) {
            return Ok(None);
        }
        let Ok(set) = GripSet::read(path) else { return Ok(None) };
        let mut request = set.provenance.request.clone();
        request.output.clone_from(output);
        request.scoring.threads = self.request.scoring.threads;
        let (low, high) = self.part.mesh.bounding_box();
        let same = set.provenance.complete
            && set.provenance.gripfast == env!("CARGO_PKG_VERSION")
            && request == self.asked()
            && set.part == self.part_summary([low, high])
            && set.gripper == output::gripper_json(&self.gripper)?
            && set.loads == self.loads;
        if !same {
            return Ok(None);
        }
        observer.note(&format!("{} holds this run, finished: nothing to resume", path.display()));
        let shown = self.shown(&set.grips, (high - low).length());
        let mut written = Vec::new();
        if let Some(page) = &output.report {
            let misses = near_misses(&set, &self.part)?;
            crate::report::write(&set, Some(&self.part.mesh), &misses, page)?;
            written.push(page.clone());
        }
        Ok(Some(Outcome { set, shown, checkpoint: None, written }))
    }

    /// Ids of the grips to show, best first.
    fn shown(&self, grips: &[RankedGrip], size: f64) -> Vec<u64> {
        let selection = &self.request.selection;
        let chosen = if selection.diverse {
            rank::choose_diverse(grips, selection.top, size)
        } else {
            let first = self.first_of_turns(grips);
            let first = grips.iter().zip(first).filter_map(|(grip, first)| first.then_some(grip));
            first.take(selection.top).collect()
        };
        chosen.into_iter().map(|ranked| ranked.grip.id).collect()
    }

    /// Which of the grips no turn of the part maps to a better one; all where every turn is shown.
    fn first_of_turns(&self, grips: &[RankedGrip]) -> Vec<bool> {
        match self.symmetry.filter(|_| !self.request.selection.every_turn) {
            None => vec![true; grips.len()],
            Some(symmetry) => {
                let firsts = rank::first_turns(grips, symmetry, self.gripper.is_symmetric());
                grips.iter().zip(firsts).map(|(grip, first)| grip.grip.id == first).collect()
            }
        }
    }

    /// How many of the best grips are kept: of a round part as many more as there are turns, where
    /// one is shown for them.
    fn keep(&self) -> usize {
        let kept = self.request.kept();
        let selection = &self.request.selection;
        if self.symmetry.is_none() || selection.every_turn || selection.keep.is_some() {
            return kept;
        }
        let turns = std::f64::consts::TAU / self.propose.angle_step;
        kept.max(((selection.top as f64 * turns).ceil() as usize).min(KEEP))
    }

    /// The grips for the list: all, or as many that differ as the request wants to keep.
    fn kept(&self, grips: Vec<RankedGrip>, size: f64) -> Vec<RankedGrip> {
        let selection = &self.request.selection;
        match selection.keep.filter(|_| selection.diverse) {
            None => grips,
            Some(keep) => {
                let keep = keep.max(selection.top).max(1);
                rank::choose_diverse(&grips, keep, size).into_iter().cloned().collect()
            }
        }
    }

    fn rank_options(&self) -> rank::Options {
        rank::Options {
            weights: self.settings.weights,
            pads: self.settings.pads,
            keep_flips: self.propose.flips,
            merge_duplicates: self.request.selection.merge_symmetric,
            symmetry: self.symmetry,
            jaws_alike: self.gripper.is_symmetric(),
            top: Some(self.keep()),
            ..rank::Options::default()
        }
    }

    /// Tries the grips to show at uncertain poses, where the request asks for it.
    fn add_noise(
        &self,
        proposer: &Proposer<'_>,
        assessor: &Assessor<'_>,
        grips: &mut [RankedGrip],
        shown: &[u64],
    ) -> Result<()> {
        let Some(error) = self.request.selection.pose_noise else { return Ok(()) };
        let samples = self.request.selection.noise_samples;
        let noise = Noise { shift: error.shift.0, turn: error.turn.0, samples };
        let mut chosen: Vec<&mut RankedGrip> =
            grips.iter_mut().filter(|ranked| shown.contains(&ranked.grip.id)).collect();
        noise.assess(proposer, assessor, &mut chosen)
    }

    /// Solves the loads that cannot be the worst, for all grips or for those on a page.
    fn solve_other_loads(
        &self,
        assessor: &Assessor<'_>,
        grips: &mut [RankedGrip],
        shown: &[u64],
    ) -> Result<()> {
        let every = self.request.scoring.polish == Polish::All;
        if !every && self.request.output.report.is_none() {
            return Ok(());
        }
        let shown = &shown[..shown.len().min(WHOLE)];
        let chosen = grips
            .iter_mut()
            .enumerate()
            .filter(|(place, ranked)| every || *place < WHOLE || shown.contains(&ranked.grip.id));
        let mut chosen: Vec<&mut RankedGrip> = chosen.map(|(_, ranked)| ranked).collect();
        assessor.solve_every_load(&mut chosen)
    }

    fn provenance(&self, backend: String, complete: bool) -> Provenance {
        let resolved = Resolved {
            pad_stiffness: self.gripper.layer().stiffness,
            force: Force(self.settings.force),
            spacing: Length(self.propose.spacing(&self.gripper)),
            pad_friction: self.settings.pads.value,
            safety: self.settings.pads.safety,
            seeds: self.seeds.len(),
            keep: self.keep(),
        };
        let mut provenance = Provenance::new(self.asked(), resolved);
        provenance.command.clone_from(&self.command);
        provenance.backend = backend;
        provenance.complete = complete;
        provenance.warnings.clone_from(&self.warnings);
        provenance
    }

    /// The request as it was made.
    fn asked(&self) -> Request {
        let mut request = self.request.clone();
        request.scoring.polish = self.asked_polish;
        request
    }

    fn part_summary(&self, [bbox_min, bbox_max]: [DVec3; 2]) -> PartSummary {
        PartSummary {
            file: self.part.file.display().to_string(),
            unit_m: self.part.unit_m,
            triangles: self.part.mesh.triangles.len(),
            bbox_min,
            bbox_max,
            mass: self.mass,
            symmetry: self.symmetry,
        }
    }
}
