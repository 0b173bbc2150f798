//! Poses from outside: the stretch of facing planes that one grips, and the grip that it makes there
//! when the jaws have closed.

use glam::DVec2;

use super::patch::Scratch;
use super::work::{self, Known};
use super::{Explanation, Proposer, site};
use crate::error::Result;
use crate::geometry::patch_area;
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
    /// normal by `turn` \[rad\] at most and they stand between the opened pads. Of several in one middle
    /// those that the jaws meet first.
    ///
    /// # Errors
    /// The reason, when there are none.
    pub fn fit(&self, part_from_grip: &Frame, turn: f64) -> std::result::Result<Fit, Misfit> {
        let mut nearest: Option<f64> = None;
        // By how far they are off the pose \[m\].
        let mut fits: Vec<(f64, Fit)> = Vec::new();
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
                let angle = local.rotation.x_axis.truncate().to_angle();
                let shifted = local.origin.z.abs();
                let [aside, off_row] = site.off_row(position, angle);
                let jaws = site::jaws(&local);
                let fit = Fit { site: index, position, angle, jaws, gap, turned, shifted };
                fits.push((shifted + reach * turned + aside + 1e-3 * reach * off_row, fit));
            }
        }
        fits.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.site.cmp(&b.1.site)));
        let touched = |(_, fit): &(f64, Fit), least: f64| {
            let contact = self.grip_at(fit, 0).contact;
            [&contact.face_i, &contact.face_ii].iter().all(|face| patch_area(face) > least)
        };
        let is_inside = |fit: &Fit| self.sites[fit.site].kind == PairKind::Internal;
        // Jaws that close on a stepped shaft meet the thickest step under the pads, whichever is listed
        // first.
        let first_met = |nearest: &(f64, Fit)| {
            let inside = is_inside(&nearest.1);
            let sense = if inside { 1.0 } else { -1.0 };
            let as_near = fits.iter().take_while(|other| other.0 <= nearest.0 + ROUNDING);
            let alike = as_near.filter(|other| is_inside(&other.1) == inside);
            // More than what rounding moves a pad over an edge.
            let met: Vec<Fit> = alike
                .filter(|other| touched(other, ROUNDING * reach))
                .map(|other| other.1)
                .collect();
            let first = met.iter().map(|fit| sense * fit.gap).fold(f64::INFINITY, f64::min);
            // Of those as near the one whose candidates come first.
            let met = met.into_iter().filter(|fit| sense * fit.gap <= first + ROUNDING);
            met.min_by_key(|fit| fit.site).unwrap_or(nearest.1)
        };
        let fit = fits.iter().find(|fit| touched(fit, 0.0)).map(first_met);
        match (fit.or(fits.first().map(|first| first.1)), nearest) {
            (Some(fit), _) => Ok(fit),
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
