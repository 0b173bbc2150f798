//! Poses from outside: the stretch of facing planes that one grips, and the grip that it makes there
//! when the jaws have closed.

use glam::DVec2;

use super::patch::Scratch;
use super::work::{self, Known};
use super::{Explanation, Proposer, site};
use crate::error::Result;
use crate::gripper::Jaws;
use crate::model::{Frame, Grip};
use crate::part::PairKind;

/// Rounding of places in files of other programs \[m\].
const ROUNDING: f64 = 1e-6;

/// A pose as closing jaws leave it: pads flat on the faces, the faces midway between them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Fit {
    /// Number of the site: its place in [`Proposer::sites`].
    pub site: usize,
    /// Grip origin in the site's `(x, y)` \[m\].
    pub position: DVec2,
    /// Approach angle from the site's `x` \[rad\].
    pub angle: f64,
    /// Which way round the gripper is put.
    pub jaws: Jaws,
    /// Distance of the pads \[m\].
    pub gap: f64,
    /// Angle by which the closing axis was off the faces' normal \[rad\].
    pub turned: f64,
    /// Way along the closing axis by which the pose was off the middle \[m\].
    pub shifted: f64,
}

/// Why a pose fits no pair of faces.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Misfit {
    /// No pair of faces within the stroke has a normal so near to the closing axis; the angle to
    /// the nearest \[rad\], `None` without any pair.
    Tilted(Option<f64>),
    /// There are such faces, but not between the opened pads.
    Beside,
}

impl Proposer<'_> {
    /// The faces that a gripper at `part_from_grip` closes on, when its closing axis is off their
    /// normal by `turn` \[rad\] at most and they stand between the opened pads.
    ///
    /// # Errors
    /// The reason, when there are none.
    pub fn fit(&self, part_from_grip: &Frame, turn: f64) -> std::result::Result<Fit, Misfit> {
        let mut nearest: Option<f64> = None;
        let mut fits: Vec<Fit> = Vec::new();
        let reach = self.gripper.pad_reach();
        for (index, site) in self.sites.iter().enumerate() {
            let local = site.part_from_site.inverse().compose(part_from_grip);
            let off = local.rotation.z_axis;
            let turned = off.truncate().length().atan2(off.z.abs());
            nearest = Some(nearest.map_or(turned, |known| known.min(turned)));
            let position = local.origin.truncate();
            let within = position.clamp(site.bounds.min, site.bounds.max);
            let gap = site.gap(self.gripper);
            let inside = site.kind == PairKind::Internal;
            let opened = self.gripper.opened(gap, inside, self.options.opening);
            let room = ((opened - gap).abs() / 2.0).max(ROUNDING);
            if turned <= turn + 1e-9
                && position.distance(within) <= reach
                && local.origin.z.abs() <= room
            {
                fits.push(Fit {
                    site: index,
                    position,
                    angle: local.rotation.x_axis.truncate().to_angle(),
                    jaws: site::jaws(&local),
                    gap,
                    turned,
                    shifted: local.origin.z.abs(),
                });
            }
        }
        fits.sort_by(|a, b| {
            let off = |fit: &Fit| {
                let [aside, turned] = self.sites[fit.site].off_row(fit.position, fit.angle);
                fit.shifted + reach * fit.turned + aside + 1e-3 * reach * turned
            };
            off(a).total_cmp(&off(b)).then(a.site.cmp(&b.site))
        });
        let touches = |fit: &&Fit| {
            let contact = self.grip_at(fit, 0).contact;
            !contact.face_i.is_empty() && !contact.face_ii.is_empty()
        };
        match (fits.iter().find(touches).or(fits.first()), nearest) {
            (Some(fit), _) => Ok(*fit),
            (None, Some(angle)) if angle <= turn + 1e-9 => Err(Misfit::Beside),
            (None, nearest) => Err(Misfit::Tilted(nearest)),
        }
    }

    /// The grip at a fit, whether it is free or not; a pad that touches nothing has an empty area.
    pub fn grip_at(&self, fit: &Fit, id: u64) -> Grip {
        let site = &self.sites[fit.site];
        let axes = site::axes(self.directions[site.direction]);
        let patches = site.patches(self.part, &axes, self.gripper.pad_reach());
        let (mut scratch, mut known) = ([Scratch::default(), Scratch::default()], Known::default());
        let Fit { position, angle, jaws, .. } = *fit;
        let touched =
            self.contact_at(site, &patches, (position, angle, jaws), &mut scratch, &mut known);
        let mut part_from_grip = work::frame(site, position, angle);
        part_from_grip.rotation *= jaws.turn();
        let mut faces = [0, 1].map(|side| site.face_at(side, self.part, position));
        if jaws == Jaws::Exchanged {
            faces.reverse();
        }
        Grip {
            id,
            part_from_grip,
            width: site.width,
            face_i: faces[0],
            face_ii: faces[1],
            angle,
            contact: touched.contact,
            surfaces: touched.surfaces,
            inside: site.kind == PairKind::Internal,
            flip_of: None,
        }
    }

    /// Every test of the grip at a fit.
    ///
    /// # Errors
    /// As [`Proposer::explain`].
    pub fn explain_fit(&self, fit: &Fit) -> Result<Explanation> {
        self.explain(fit.site, fit.position, fit.angle, fit.jaws)
    }
}
