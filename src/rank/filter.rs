//! Which grips of a result are taken along: chosen ones, those on some faces, from some directions,
//! that hold, that differ.

use super::choose_diverse;
use crate::error::{Error, Result};
use crate::gripper::Gripper;
use crate::request::Cone;
use crate::results::{GripSet, PadFriction, RankedGrip};

/// A choice among the grips of a result; the default takes all.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Filter {
    /// Only the grips with these numbers.
    pub ids: Option<Vec<u64>>,
    /// Only grips both of whose faces are among these.
    pub faces: Option<Vec<u32>>,
    /// Only approaches within this cone (part frame).
    pub approach: Option<Cone>,
    /// Only grips in which at least this share of the pad touches on both faces.
    pub min_pad_share: Option<f64>,
    /// Only grips that hold.
    pub holding: bool,
    /// By these they are judged; those of the set when absent.
    pub pads: Option<PadFriction>,
    /// Only the best of the grips that a turn about the axis of a round part maps to each other.
    pub one_turn: bool,
    /// Grips that differ in place, face pair and approach rather than the first ones.
    pub diverse: bool,
    /// The first of those that are left, or as many that differ.
    pub top: Option<usize>,
}

impl Filter {
    /// Leaves the grips of a set that pass, in their order and with their ranks.
    ///
    /// # Errors
    /// When a number is that of no grip in the set, the share of the pad is asked for and the set
    /// states no pad, or what holds is asked for and the friction of the pads is not known.
    pub fn apply(&self, set: &mut GripSet) -> Result<()> {
        if let Some(ids) = &self.ids {
            let known = |id: &&u64| !set.grips.iter().any(|ranked| ranked.grip.id == **id);
            if let Some(id) = ids.iter().find(known) {
                return Err(Error::input(
                    "ids",
                    format!("the result holds no grip {id}"),
                    "give ids as the table of the plan lists them",
                )
                .with_options(&["ids"]));
            }
        }
        let gripper = self.min_pad_share.map(|_| set.read_gripper()).transpose()?;
        let pads = self.pads.unwrap_or_else(|| set.pads());
        if self.holding && pads.value.is_none() {
            return Err(Error::input(
                "holding",
                "the result does not state the friction of the pads",
                "plan again with it",
            )
            .with_options(&["holding", "pad_friction"]));
        }
        set.grips.retain(|ranked| {
            self.passes(ranked, gripper.as_ref())
                && (!self.holding || pads.verdict(ranked.friction_needed()).holds() == Some(true))
        });
        if self.one_turn {
            let mut firsts = super::turned(set).into_iter();
            set.grips.retain(|ranked| firsts.next() == Some(ranked.grip.id));
        }
        let top = self.top.unwrap_or(usize::MAX).min(set.grips.len());
        if self.diverse {
            let size = (set.part.bbox_max - set.part.bbox_min).length();
            set.grips = choose_diverse(&set.grips, top, size).into_iter().cloned().collect();
        } else {
            set.grips.truncate(top);
        }
        Ok(())
    }

    fn passes(&self, ranked: &RankedGrip, gripper: Option<&Gripper>) -> bool {
        let grip = &ranked.grip;
        let among =
            |faces: &Vec<u32>| faces.contains(&grip.face_i) && faces.contains(&grip.face_ii);
        let within = |cone: &Cone| {
            let approach = grip.part_from_grip.rotation.x_axis;
            approach.angle_between(cone.axis) <= cone.half_angle + 1e-9
        };
        let touches = |gripper: &Gripper| {
            let least = self.min_pad_share.unwrap_or(0.0);
            gripper.pad_share(&grip.contact) >= least * (1.0 - 1e-9)
        };
        self.ids.as_ref().is_none_or(|ids| ids.contains(&grip.id))
            && self.faces.as_ref().is_none_or(among)
            && self.approach.as_ref().is_none_or(within)
            && gripper.is_none_or(touches)
    }
}
