//! Poses from outside: taught ones, or those of another program, assessed as the grips of a plan are,
//! and where one of them stands among the grips that the plan finds.

use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::search::Search;
use super::{Assessor, Plan, output};
use crate::backend::select;
use crate::error::Result;
use crate::export::tool_in_grip;
use crate::gripper::Gripper;
use crate::model::{Frame, Grip};
use crate::part::Part;
use crate::poses::Pose;
use crate::propose::{Explanation, Fit, Misfit, ProposeOptions, Proposer};
use crate::rank;
use crate::results::{GripSet, PadFriction, Provenance, RankedGrip, Summary};

/// Poses within this \[m\] and this \[rad\] are one pose: what files with six digits keep.
const SAME_PLACE: f64 = 2e-6;
const SAME_TURN: f64 = 1e-5;
/// Angle off a closing direction from which on a round face is looked at in the pose's own \[rad\].
const OFF: f64 = 1e-3;

/// What became of a pose.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Assessed {
    /// Its name.
    pub name: String,
    /// The faces that it grips, or why there are none.
    pub fit: std::result::Result<Fit, Misfit>,
    /// Every test of it, where it grips two faces.
    pub explanation: Option<Explanation>,
    /// Its numbers, where it touches both faces, free or not.
    pub ranked: Option<RankedGrip>,
    /// The limit of the gripper that a load exceeds there, as rejections name it.
    pub over: Option<String>,
}

impl Assessed {
    /// Whether nothing stands in its way.
    pub fn is_free(&self) -> bool {
        self.rejection().is_none()
    }

    /// What stands in its way, by the name that a plan counts it under.
    pub fn rejection(&self) -> Option<String> {
        let Some(explanation) = &self.explanation else { return Some("no_faces".to_owned()) };
        explanation.rejection.as_ref().map(|rejection| rejection.name()).or(self.over.clone())
    }

    /// What it is, in a few words; `set` is that of its [`Assessment`].
    pub fn verdict(&self, set: &GripSet) -> String {
        match (&self.fit, &self.explanation, &self.ranked) {
            (Err(Misfit::Tilted(Some(angle))), ..) => {
                format!("no faces: the nearest pair is {:.1} deg off", angle.to_degrees())
            }
            (Err(Misfit::Beside), ..) => "no faces between the opened pads".into(),
            (Err(_), ..) => "no pair of faces within the stroke".into(),
            (_, Some(explanation), _) if explanation.rejection.is_some() => {
                format!("not free: {}", self.rejection().unwrap_or_default().replace('_', " "))
            }
            _ if self.over.is_some() => self.rejection().unwrap_or_default().replace('_', " "),
            (.., Some(ranked)) if ranked.worst.status.holds() => {
                match set.verdict(ranked).holds() {
                    Some(false) => "slips".into(),
                    Some(true) => "holds".into(),
                    None => "free".into(),
                }
            }
            (.., Some(ranked)) => {
                let name = rank::status_name(ranked.worst.status).replace('_', " ");
                match ranked.load_multiple {
                    Some(held) if held < 1.0 => {
                        format!("{name}: the worst load is held to {:.0} %", held * 100.0)
                    }
                    _ => name,
                }
            }
            _ => "no contact".into(),
        }
    }

    /// All of it as `gripfast assess --json` prints it: `name`, `verdict`, `free`, `faces` (two
    /// numbers), `failed` (tests, as text), `turned_rad`, `shifted_m`, `grip`.
    pub fn to_json(&self, set: &GripSet) -> serde_json::Value {
        let checks = self.explanation.as_ref().map(|explanation| {
            let failed = explanation.checks.iter().filter(|check| !check.passed);
            failed.map(|check| format!("{}: {}", check.name, check.detail)).collect::<Vec<_>>()
        });
        let faces = self.explanation.as_ref().map(|found| [found.face_i, found.face_ii]);
        let (turned, shifted) =
            self.fit.map_or((None, None), |fit| (Some(fit.turned), Some(fit.shifted)));
        serde_json::json!({
            "name": self.name, "verdict": self.verdict(set), "free": self.is_free(),
            "faces": faces, "failed": checks, "turned_rad": turned, "shifted_m": shifted,
            "grip": self.ranked,
        })
    }

    /// Whether it is free and a limit state exists for its worst load.
    pub fn is_grip(&self) -> bool {
        self.is_free() && self.ranked.as_ref().is_some_and(|ranked| ranked.worst.status.holds())
    }
}

/// What became of a list of poses.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Assessment {
    /// In the order of the list.
    pub poses: Vec<Assessed>,
    /// Those that are grips, ranked as a plan's; their ids are the places in the list, from 0.
    pub set: GripSet,
}

/// Where a pose stands among the grips that a plan finds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Standing {
    /// It is the grip of this rank and id.
    Found {
        /// Its rank.
        rank: u64,
        /// Its id.
        id: u64,
    },
    /// It is none of them.
    NotTried {
        /// The rank that its score would have.
        rank: u64,
        /// Whether the list that was kept ends before that rank.
        beyond: bool,
        /// Rank, id and distance \[m\] of the nearest grip found on the same faces.
        nearest: Option<(u64, u64, f64)>,
    },
}

impl Plan {
    /// Assesses poses of the gripper on the part: which faces each one grips, every test, and its
    /// numbers under the loads. A pose may be off the faces' normal by `turn` \[rad\]: closing jaws
    /// right it.
    ///
    /// # Errors
    /// As [`Proposer::new`] and [`Assessor::assess`]; when poses are those of a frame that the
    /// gripper does not state.
    pub fn assess(&self, poses: &[Pose], turn: f64) -> Result<Assessment> {
        self.threads.install(|| {
            let scoring = &self.request.scoring;
            let selection = select(scoring.backend, scoring.adapter.as_deref())?;
            let assessor = self.assessor(&selection.backend);
            let proposer = self.proposer_for(poses, turn)?;
            let poses = self.assess_on(&proposer, &assessor, poses, turn)?;
            let set = self.set_of(&proposer, &selection.backend.name(), &poses)?;
            Ok(Assessment { poses, set })
        })
    }

    /// Assesses one pose, given as a grip frame in the part frame, and says where it stands among
    /// the grips that the plan finds; nowhere when it is no grip. Writes no file.
    ///
    /// # Errors
    /// As [`Plan::run`].
    pub fn place(
        &self,
        part_from_grip: &Frame,
        turn: f64,
    ) -> Result<(Assessed, Option<(Standing, u64)>)> {
        self.threads.install(|| {
            let scoring = &self.request.scoring;
            let selection = select(scoring.backend, scoring.adapter.as_deref())?;
            let assessor = self.assessor(&selection.backend);
            let pose = [Pose::of_grip("pose", *part_from_grip)];
            let proposer = self.proposer_for(&pose, turn)?;
            let mut assessed = self.assess_on(&proposer, &assessor, &pose, turn)?;
            let assessed = assessed.remove(0);
            if !assessed.is_grip() {
                return Ok((assessed, None));
            }
            let mut proposer = Proposer::new(&self.part, &self.gripper, &self.propose)?;
            // Every grip counts for a rank.
            let search = Search {
                assessor: &assessor,
                keep: self.keep(),
                race: false,
                sample: 0,
                partial: None,
                resume: false,
                ids: None,
                flips: self.propose.flips,
            };
            let found = search.run(&mut proposer, &mut (), &AtomicBool::new(false))?;
            let (low, high) = self.part.mesh.bounding_box();
            let (centre, size) = (self.mass.centre_of_mass, (high - low).length());
            let all = found.collector.finish(centre, size, &self.rank_options());
            let pads = self.settings.pads;
            let standing = assessed.ranked.as_ref().map(|ranked| standing(ranked, &all, pads));
            Ok((assessed, standing.map(|standing| (standing, all.ranked))))
        })
    }

    /// With the plan's candidates and those of poses beside them, on tapers and round faces.
    fn proposer_for(&self, poses: &[Pose], turn: f64) -> Result<Proposer<'_>> {
        let plain = Proposer::new(&self.part, &self.gripper, &self.propose)?;
        if !(plain.has_rows() || plain.has_round()) {
            return Ok(plain);
        }
        let fitted: Vec<(f64, std::result::Result<Fit, Misfit>)> =
            poses.par_iter().map(|pose| self.fitted(&plain, pose, turn)).collect::<Result<_>>()?;
        let is_off = |(_, fit): &(f64, std::result::Result<Fit, Misfit>)| match fit {
            Ok(fit) => fit.turned > OFF,
            Err(_) => true,
        };
        if !(plain.has_rows() || fitted.iter().any(is_off)) {
            return Ok(plain);
        }
        let frames = poses.iter().zip(&fitted).map(|(pose, (gap, _))| self.grip_frame(pose, *gap));
        let frames = frames.collect::<Result<_>>()?;
        // Those rows must not be the ones that make curved faces too many.
        let options = self.propose.clone().with_curved(Some(true)).with_poses(frames);
        Proposer::new(&self.part, &self.gripper, &options)
    }

    /// The grip frame of a pose with the pads `gap` apart.
    fn grip_frame(&self, pose: &Pose, gap: f64) -> Result<Frame> {
        let tool = tool_in_grip(pose.convention, pose.origin, Some(&self.gripper), gap)?;
        Ok(pose.part_from_tool.compose(&tool.inverse()))
    }

    /// Distance of the pads in a pose, and what it fits: flange and tool stand by how far the jaws close,
    /// which the faces decide.
    fn fitted(
        &self,
        proposer: &Proposer<'_>,
        pose: &Pose,
        turn: f64,
    ) -> Result<(f64, std::result::Result<Fit, Misfit>)> {
        let mut gap =
            pose.gap.unwrap_or(f64::midpoint(self.gripper.stroke[0], self.gripper.stroke[1]));
        let mut fit = proposer.fit(&self.grip_frame(pose, gap)?, turn);
        for _ in 0..4 {
            match &fit {
                Ok(found) if (found.gap - gap).abs() > 1e-9 => gap = found.gap,
                _ => break,
            }
            fit = proposer.fit(&self.grip_frame(pose, gap)?, turn);
        }
        Ok((gap, fit))
    }

    fn assess_on(
        &self,
        proposer: &Proposer<'_>,
        assessor: &Assessor<'_>,
        poses: &[Pose],
        turn: f64,
    ) -> Result<Vec<Assessed>> {
        let tried: Vec<(Assessed, Option<Grip>)> = poses
            .par_iter()
            .enumerate()
            .map(|(index, pose)| self.try_pose(proposer, pose, index as u64, turn))
            .collect::<Result<_>>()?;
        let grips: Vec<Grip> = tried.iter().filter_map(|(_, grip)| grip.clone()).collect();
        let over: Vec<Option<String>> = grips.par_iter().map(|grip| assessor.over(grip)).collect();
        let mut scored = assessor.assess(grips)?;
        assessor.finish(&mut scored)?;
        let mut scored = scored.into_iter().zip(over);
        Ok(tried
            .into_iter()
            .map(|(mut assessed, grip)| {
                assessed.ranked = grip.and_then(|_| scored.next()).map(|(mut ranked, over)| {
                    assessed.over = over;
                    let mu_s = ranked.worst.mu_s.filter(|_| ranked.worst.status.holds());
                    ranked.score = mu_s
                        .map(|mu_s| self.settings.weights.score(mu_s, ranked.alpha))
                        .filter(|score| score.is_finite());
                    ranked
                });
                assessed
            })
            .collect())
    }

    /// The faces that a pose grips, every test, and the grip where both pads touch.
    fn try_pose(
        &self,
        proposer: &Proposer<'_>,
        pose: &Pose,
        id: u64,
        turn: f64,
    ) -> Result<(Assessed, Option<Grip>)> {
        let (_, fit) = self.fitted(proposer, pose, turn)?;
        let mut assessed =
            Assessed { name: pose.name.clone(), fit, explanation: None, ranked: None, over: None };
        let Ok(fit) = fit else { return Ok((assessed, None)) };
        assessed.explanation = Some(proposer.explain_fit(&fit)?);
        let grip = proposer.grip_at(&fit, id);
        let touches = !grip.contact.face_i.is_empty() && !grip.contact.face_ii.is_empty();
        Ok((assessed, touches.then_some(grip)))
    }

    /// The result file of poses that are grips.
    fn set_of(
        &self,
        proposer: &Proposer<'_>,
        backend: &str,
        poses: &[Assessed],
    ) -> Result<GripSet> {
        let (low, high) = self.part.mesh.bounding_box();
        let free = poses.iter().filter(|pose| pose.is_free());
        let grips: Vec<RankedGrip> = free.filter_map(|pose| pose.ranked.clone()).collect();
        let options = rank::Options { keep_flips: true, top: None, ..self.rank_options() };
        let ranking = rank::rank(grips, self.mass.centre_of_mass, (high - low).length(), &options);
        let mut rejections = ranking.rejections;
        for reason in poses.iter().filter_map(Assessed::rejection) {
            *rejections.entry(reason).or_default() += 1;
        }
        let mut set = GripSet::new(
            self.provenance(backend.to_owned(), true),
            self.part_summary([low, high]),
            output::gripper_json(&self.gripper)?,
            self.loads.clone(),
        );
        set.summary = Summary {
            pairs: proposer.tally().pairs,
            candidates: poses.len() as u64,
            ranked: ranking.ranked,
            holding: self.settings.pads.value.map(|_| ranking.holding),
            rejections,
            comparison: None,
        };
        set.grips = ranking.grips;
        Ok(set)
    }
}

/// Part, gripper and options as the run that made a set had them.
pub(super) fn of_run(set: &GripSet, part: &Part) -> Result<(Part, Gripper, ProposeOptions)> {
    let Provenance { request, resolved, .. } = &set.provenance;
    let mut options = ProposeOptions::read(&request.candidates)?;
    options.force = Some(resolved.force.0).filter(|force| *force > 0.0);
    let mut part = part.clone();
    part.set_centre_of_mass(set.part.mass.centre_of_mass);
    Ok((part, set.read_gripper()?, options))
}

/// Every test of a grip of a result, with the options of its run.
///
/// # Errors
/// When the gripper of the result or the scene of its request cannot be read; as
/// [`Proposer::new`].
pub fn explain(set: &GripSet, ranked: &RankedGrip, part: &Part) -> Result<Explanation> {
    let (part, gripper, options) = of_run(set, part)?;
    let grip = &ranked.grip;
    Proposer::new(&part, &gripper, &options)?.explain_pose(
        grip.face_i,
        grip.face_ii,
        &grip.part_from_grip,
    )
}

/// Where a grip stands among others in order.
fn standing(ranked: &RankedGrip, all: &rank::Ranking, pads: PadFriction) -> Standing {
    let grip = &ranked.grip;
    let merit = |grip: &RankedGrip| {
        let slips = pads.verdict(grip.friction_needed()).holds() == Some(false);
        rank::merit(grip.score.unwrap_or(f64::INFINITY), slips)
    };
    let apart = |other: &Grip| other.part_from_grip.origin.distance(grip.part_from_grip.origin);
    let turned = |other: &Grip| {
        let [a, b] = [grip, other].map(|grip| grip.part_from_grip.rotation);
        let angle = a.x_axis.cross(b.x_axis).length().atan2(a.x_axis.dot(b.x_axis));
        // The same pose with exchanged jaws is the same grip of a symmetric gripper.
        angle.max(a.z_axis.cross(b.z_axis).length())
    };
    let same =
        |other: &&RankedGrip| apart(&other.grip) < SAME_PLACE && turned(&other.grip) < SAME_TURN;
    if let Some(found) = all.grips.iter().find(same) {
        return Standing::Found { rank: found.rank, id: found.grip.id };
    }
    let better = all.grips.iter().filter(|other| merit(other) > merit(ranked)).count() as u64;
    let faces = |grip: &Grip| (grip.face_i.min(grip.face_ii), grip.face_i.max(grip.face_ii));
    let on_the_same = all.grips.iter().filter(|other| faces(&other.grip) == faces(grip));
    let nearest = on_the_same
        .map(|other| (other.rank, other.grip.id, apart(&other.grip), turned(&other.grip)))
        .min_by(|a, b| (a.2 + 0.05 * a.3).total_cmp(&(b.2 + 0.05 * b.3)))
        .map(|(rank, id, apart, _)| (rank, id, apart));
    let beyond = better == all.grips.len() as u64 && all.ranked > better;
    Standing::NotTried { rank: better + 1, beyond, nearest }
}
