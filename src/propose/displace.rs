//! Grips displaced in their pad plane, with what the pads then touch.

use glam::{DMat3, DVec2};

use super::patch::{PatchIndex, Scratch, Touch};
use super::site::Site;
use super::work::{Known, Pads, Touched};
use super::{proposer::Proposer, site};
use crate::error::Result;
use crate::gripper::Jaws;
use crate::model::{Frame, Grip};

/// By how much a grip stands off its pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Displacement {
    /// Shift of the grip origin along its `x1` and `x2` \[m\].
    pub shift: DVec2,
    /// Turn about its closing axis \[rad\].
    pub turn: f64,
}

impl Proposer<'_> {
    /// `grip`, one of this part and gripper, at each of the displaced poses: frame, faces and
    /// contact areas are those of the new pose; a pad that touches nothing has an empty area.
    /// Interference and the smallest contact area are not tested.
    ///
    /// # Errors
    /// When the part has no such face pair for this gripper, or the frame's closing axis is not its
    /// normal.
    pub fn displaced(&self, grip: &Grip, by: &[Displacement]) -> Result<Vec<Grip>> {
        let (index, _) = self.site_of(grip.face_i, grip.face_ii, &grip.part_from_grip)?;
        let site = &self.sites[index];
        let axes = site::axes(self.directions[site.direction]);
        let reach = self.gripper.pad_reach();
        let patches = site.patches(self.part, &axes, reach);
        let (mut scratch, mut known) = ([Scratch::default(), Scratch::default()], Known::default());
        let displaced = by.iter().map(|by| {
            let grip_from_displaced =
                Frame { rotation: DMat3::from_rotation_z(by.turn), origin: by.shift.extend(0.0) };
            let part_from_grip = grip.part_from_grip.compose(&grip_from_displaced);
            let local = site.part_from_site.inverse().compose(&part_from_grip);
            let (place, angle) =
                (local.origin.truncate(), local.rotation.x_axis.truncate().to_angle());
            let jaws = site::jaws(&local);
            let posture = (place, angle, jaws);
            let touched = self.contact_at(site, &patches, posture, &mut scratch, &mut known);
            let mut faces = [0, 1].map(|side| site.face_at(side, self.part, place));
            if jaws == Jaws::Exchanged {
                faces.reverse();
            }
            Grip {
                part_from_grip,
                face_i: faces[0],
                face_ii: faces[1],
                angle: grip.angle + by.turn,
                contact: touched.contact,
                surfaces: touched.surfaces,
                ..grip.clone()
            }
        });
        Ok(displaced.collect())
    }

    /// What the pads touch at a place of a site, at an angle, one way round.
    pub(super) fn contact_at(
        &self,
        site: &Site,
        patches: &[PatchIndex],
        (place, angle, jaws): (DVec2, f64, Jaws),
        scratch: &mut [Scratch; 2],
        known: &mut Known,
    ) -> Touched {
        let pads = Pads::new(site.pads(self.gripper, jaws), angle);
        let mut whole = [true; 2];
        for (side, patch) in pads.sides(patches) {
            let touch = patches[patch].touch(&pads.turned[side], place, &mut scratch[side]);
            whole[side] = touch == Touch::Whole;
        }
        self.contact(site, patches, &pads, place, angle, jaws, whole, scratch, known)
    }
}
