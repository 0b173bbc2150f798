//! The run-time choice: the first grip of a ranked list that is free in a scene, and why each one
//! before it was passed over.
//!
//! A [`Picker`] holds what does not change between picks (obstacles in a tree, swept gripper
//! bodies); [`Picker::pick`] takes the part's pose.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::clash::{Cell, Course, Room, Volumes};
use crate::error::Result;
use crate::gripper::Gripper;
use crate::model::{Frame, Grip};
use crate::results::{GripSet, RankedGrip, Verdict};

pub use crate::clash::{Phase, Reason};
pub use crate::scene::{Obstacle, Opening, Reach, Reference, Retreat, Scene, Solid};

/// Grips that one thread tests after each other. What a piece remembers of the last collision stays
/// within it, so that reasons do not depend on the number of threads.
const PIECE: usize = 64;

/// The outcome of a pick.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Pick {
    /// Index into the list of the first free grip.
    pub chosen: Option<usize>,
    /// Why each grip before it (or every grip) was passed over, in order.
    pub passed: Vec<Reason>,
}

/// A list of grips and a scene, ready to pick.
pub struct Picker<'a> {
    set: &'a GripSet,
    allow_slip: bool,
    gripper: Gripper,
    cell: Cell,
    /// Course and swept bodies for each width that occurs, and the number of those of each grip;
    /// without them the stroke does not suffice.
    volumes: Vec<(Course, Volumes)>,
    volumes_of: Vec<std::result::Result<u32, f64>>,
}

impl<'a> Picker<'a> {
    /// Prepares to pick from `set` in `scene`.
    ///
    /// # Errors
    /// When the gripper in `set` cannot be read.
    pub fn new(set: &'a GripSet, scene: &Scene) -> Result<Self> {
        let gripper = set.read_gripper()?;
        let mut picker = Self {
            set,
            allow_slip: false,
            gripper,
            cell: Cell::new(scene),
            volumes: Vec::new(),
            volumes_of: Vec::with_capacity(set.grips.len()),
        };
        let planned = picker.planned();
        let mut known: HashMap<(u64, bool), std::result::Result<u32, f64>> = HashMap::new();
        for RankedGrip { grip, .. } in &set.grips {
            let entry = known.entry((grip.width.to_bits(), grip.inside)).or_insert_with(|| {
                let gap = picker.gripper.jaw_gap(grip);
                let course = picker.cell.course(&picker.gripper, gap, grip.inside, planned)?;
                picker.volumes.push((course, Volumes::new(&picker.gripper, &course)));
                Ok(picker.volumes.len() as u32 - 1)
            });
            picker.volumes_of.push(*entry);
        }
        Ok(picker)
    }

    /// Takes grips too that slip, see [`GripSet::verdict`]; they are passed over otherwise.
    #[must_use]
    pub fn allow_slip(mut self, allow: bool) -> Self {
        self.allow_slip = allow;
        self
    }

    /// The way by which each jaw opens in the list: as its interference was checked.
    fn planned(&self) -> f64 {
        self.set.provenance.request.candidates.opening.0
    }

    /// The first free grip with the part at `world_from_part`.
    ///
    /// The answer, reasons included, is the same for any number of threads.
    pub fn pick(&self, world_from_part: &Frame) -> Pick {
        let mut pick = Pick::default();
        // Small groups first: most often one of the first grips is free, and a group is tested
        // whole.
        let mut size = PIECE;
        while pick.chosen.is_none() && pick.passed.len() < self.set.grips.len() {
            let start = pick.passed.len();
            let end = (start + size).min(self.set.grips.len());
            let piece = |first: usize| self.piece(first..(first + PIECE).min(end), world_from_part);
            // One piece is not worth waking the threads.
            let pieces: Vec<(Vec<Reason>, bool)> = if end - start <= PIECE {
                vec![piece(start)]
            } else {
                (start..end).into_par_iter().step_by(PIECE).map(piece).collect()
            };
            for (reasons, free) in pieces {
                pick.passed.extend(reasons);
                if free {
                    pick.chosen = Some(pick.passed.len());
                    break;
                }
            }
            size = (size * 4).min(1 << 14);
        }
        pick
    }

    /// Why the grip of this index is not free with the part at `world_from_part`; `None` when it
    /// is, or when there is no such grip.
    ///
    /// Of several collisions any may be named; [`Self::pick`] may name another one than this.
    pub fn check(&self, index: usize, world_from_part: &Frame) -> Option<Reason> {
        if index >= self.set.grips.len() {
            return None;
        }
        self.reason(index, world_from_part, &mut Room::default())
    }

    /// Reasons of a run of grips up to the first free one, and whether there is one.
    fn piece(&self, grips: std::ops::Range<usize>, world_from_part: &Frame) -> (Vec<Reason>, bool) {
        let mut reasons = Vec::with_capacity(grips.len());
        let mut room = Room::default();
        for index in grips {
            match self.reason(index, world_from_part, &mut room) {
                Some(reason) => reasons.push(reason),
                None => return (reasons, true),
            }
        }
        (reasons, false)
    }

    /// Why a grip is not free, cheapest questions first.
    fn reason(&self, index: usize, world_from_part: &Frame, room: &mut Room) -> Option<Reason> {
        let ranked = &self.set.grips[index];
        if !self.allow_slip
            && let Verdict::Slips { margin } = self.set.verdict(ranked)
        {
            return Some(Reason::Slips(margin));
        }
        let grip = &ranked.grip;
        let world_from_grip = world_from_part.compose(&grip.part_from_grip);
        let gap = self.gripper.jaw_gap(grip);
        if let Some(reason) = self.cell.beyond(&self.gripper, gap, &world_from_grip) {
            return Some(reason);
        }
        match self.volumes_of[index] {
            Ok(volumes) => {
                let (course, volumes) = &self.volumes[volumes as usize];
                let way = (course, volumes);
                self.cell.meets(&self.gripper, way, world_from_part, &grip.part_from_grip, room)
            }
            Err(gap) => Some(Reason::Stroke(gap)),
        }
    }

    /// A reason in words.
    pub fn describe(&self, reason: &Reason) -> String {
        let text = self.cell.describe(reason, &self.gripper);
        match reason {
            Reason::Slips(_) => {
                format!("{text} at {} N per jaw", self.set.provenance.resolved.force.0)
            }
            _ => text,
        }
    }

    /// A reason in one or two words, for counting.
    pub fn category(&self, reason: &Reason) -> String {
        let stop = self.cell.stop(reason);
        match reason {
            Reason::Collision { .. } => format!("collision with '{stop}'"),
            _ => stop.into(),
        }
    }

    /// Distance of the pads before closing on a grip \[m\].
    pub fn opened(&self, grip: &Grip) -> f64 {
        let gap = self.gripper.jaw_gap(grip);
        self.cell.opened(&self.gripper, gap, grip.inside, self.planned())
    }

    /// The gripper of the list.
    pub fn gripper(&self) -> &Gripper {
        &self.gripper
    }
}
