//! Planes beside which the pads press other surface too: a land that is lower by less than the layers
//! give, a gentle slope, a large fillet.

use glam::DVec2;

use super::relief::Relief;
use super::rows::{LAYER_SHARE, LEANS};
use super::survey::Survey;
use super::{Finder, Site};
use crate::contact::surface::Field;
use crate::geometry::polygon::{self, Bounds2};
use crate::geometry::{intersect_convex, overlay};
use crate::gripper::Jaws;
use crate::mechanics::curved::Pads;
use crate::model::{Gap, Patch, Piece, Ring, Surfaces};

/// Share of a pad's load above which what lies beside its plane counts, where the layer is compressed
/// twice as far as by the squeeze alone, as tilts do.
const SHARE: f64 = 0.1;
/// Share of the least contact that the planes have of one mostly on what lies beside them.
const SLIVER: f64 = 0.25;
/// Pieces beside the planes of a contact, and plane ones of these, beyond which they are left out: grips
/// would be slow, and large in files.
const MOST_PIECES: usize = 24;
const MOST_PLANES: usize = 12;
/// Places at which it is looked for, at most.
const PLACES: usize = 40;

impl Finder<'_> {
    /// What the pads of a site on planes touch, and where it may be gripped, in the axes of its
    /// direction, where they press more than the planes; `None` where that is next to nothing.
    pub(super) fn beside(
        &self,
        site: &Site,
        (heights, overlap): ([f64; 2], Bounds2),
        survey: &Survey<'_>,
    ) -> Option<(Relief, Patch)> {
        let (layer, force) = (self.gripper.layer(), self.options.force_on(self.gripper));
        let is_own = |piece: &Piece| is_own(piece, site.flush);
        let region = overlap.grown(2.0 * self.reach);
        let pieces = survey.pieces(heights, [layer.reach(), site.flush], region);
        if pieces.iter().flatten().all(is_own) {
            return None;
        }
        let relief = Relief::beside(pieces, layer, force, site.flush);
        let local = relief.moved(site.origin.truncate(), site.turn);
        let pads = site.pads(self.gripper, Jaws::Straight);
        let step = site.positions.len().div_ceil(PLACES).max(1);
        // Contacts of the planes, and the places at which their pads touch something beside them.
        let mut most = 0.0_f64;
        let mut met: Vec<(f64, Surfaces)> = Vec::new();
        for &angle in site.angles.iter().take(2) {
            let turn = DVec2::from_angle(angle);
            let rings = pads
                .each_ref()
                .map(|pad| -> Ring { pad.iter().map(|x| turn.rotate(*x)).collect() });
            for &place in site.positions.iter().step_by(step) {
                let under = local.touched([&rings[0], &rings[1]], place, angle, Jaws::Straight);
                let sides = [&under.face_i, &under.face_ii];
                let areas = sides.map(|side| {
                    let own = side.iter().filter(|piece| is_own(piece));
                    own.map(|piece| polygon::area(&piece.polygon()).abs()).sum::<f64>()
                });
                let others = || sides.into_iter().flatten().filter(|piece| !is_own(piece));
                if others().any(|piece| nearest(piece) < -2.0 * site.flush) {
                    continue;
                }
                let area = areas[0].min(areas[1]);
                most = most.max(area);
                // So many planes are facets of no known face, and so much else all of a ring's rims.
                let is_plane = |piece: &&Piece| matches!(piece.gap, Gap::Plane { .. });
                if others().count() > MOST_PIECES || others().filter(is_plane).count() > MOST_PLANES
                {
                    return None;
                }
                if others().next().is_some() {
                    met.push((area, under));
                }
            }
        }
        let floor = self.options.min_contact * most;
        let counts = |under: &Surfaces| {
            let deltas = Pads::new(under).ok()?.deltas(force)?;
            let is_felt = |pieces: &[Piece], delta: f64| {
                let load = |piece: &Piece| Field::new(piece).area_and_load(delta, DVec2::ZERO).1;
                let others = pieces.iter().filter(|piece| !is_own(piece)).map(load);
                others.sum::<f64>() > SHARE * pieces.iter().map(load).sum::<f64>()
            };
            let sides = [&under.face_i, &under.face_ii];
            Some((0..2).any(|side| is_felt(sides[side], 2.0 * deltas[side])))
        };
        let mut enough = met.iter().filter(|(area, _)| *area > 0.0 && *area >= floor);
        if !enough.any(|(_, under)| counts(under).unwrap_or(false)) {
            return None;
        }
        // A land counts that a quarter of the least contact would let the pads reach.
        let deepest = force / (layer.stiffness * SLIVER * floor);
        let deepest = deepest.min(LAYER_SHARE * layer.reach());
        let relief = relief.with_deltas([deepest; 2]);
        // As far as a pad that touches the planes gets.
        let Bounds2 { min, max } = overlap.grown(self.reach);
        let window = [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)];
        let level = relief.pressed.each_ref().map(|areas| intersect_convex(&window, areas));
        let overlap = overlay::intersect(&level[0], &level[1]);
        (!overlap.is_empty()).then_some((relief, overlap))
    }
}

/// Whether a piece lies in the pads' own plane.
pub(super) fn is_own(piece: &Piece, flush: f64) -> bool {
    let Gap::Plane { height, slope } = piece.gap else { return false };
    is_level(piece) && piece.outer.iter().all(|at| (height + slope.dot(*at)).abs() <= flush)
}

/// Whether a piece is plane and square to the closing direction.
pub(super) fn is_level(piece: &Piece) -> bool {
    matches!(piece.gap, Gap::Plane { slope, .. } if slope.length() < LEANS)
}

/// Smallest gap over a piece's corners \[m\].
fn nearest(piece: &Piece) -> f64 {
    let field = Field::new(piece);
    let corners = field.rings.iter().flatten();
    corners.map(|corner| field.gap.value(*corner)).fold(f64::INFINITY, f64::min)
}
