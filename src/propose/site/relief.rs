//! What the pads of a site touch where it is not plane: all of the part's surface within reach of
//! the pads' layers, as pieces with gaps.

use glam::{DAffine2, DVec2, DVec3};

use super::beside::{is_level, is_own};
use super::places::Edge;
use super::shapes::to_site;
use crate::contact::surface::{Shape, Spot, mapped, pressed};
use crate::geometry::polygon;
use crate::gripper::{Jaws, Layer};
use crate::mechanics::curved::Pads;
use crate::model::{Contact, Gap, Patch, Piece, Polygon, Ring, Surfaces};
use crate::propose::options::ProposeOptions;

/// Step of the approach angle about a point contact, at least \[rad\].
const POINT_STEP: f64 = 45.0 * std::f64::consts::PI / 180.0;

/// Crests whose directions differ by less from along or across one are approached as that (sine of the
/// angle).
const IN_LINE: f64 = 0.05;

/// What the pads of a site touch.
#[derive(Debug, Clone)]
pub(in crate::propose) struct Relief {
    /// Pieces on side I and II in the site's `(x, y)`; gaps are those behind the site's planes.
    pieces: [Vec<(Piece, Shape)>; 2],
    /// What is pressed on either side by pads as far as they press one piece over its middle, of planes
    /// the level surface that is pressed where it is needed for a contact: the measure of a contact before
    /// it is solved.
    pub(in crate::propose) pressed: [Patch; 2],
    layer: Layer,
    force: f64,
    /// Compressions at the planes of these pads \[m\], near which those of others are looked for.
    deltas: [f64; 2],
    /// Where the pads rest on planes square to the closing direction, and press what lies beside these
    /// too: how rough the planes are \[m\].
    flush: Option<f64>,
}

impl Relief {
    /// With the pressure of a pad over `place`; `None` where it presses nothing on one side.
    pub(super) fn new(
        pieces: [Vec<Piece>; 2],
        layer: Layer,
        force: f64,
        pads: &[Ring; 2],
        place: DVec2,
    ) -> Option<Self> {
        let (pieces, deltas) = (shaped(pieces), [0.0; 2]);
        let pressed = Default::default();
        let relief = Self { pieces, pressed, layer, force, deltas, flush: None };
        let rings = pads.each_ref().map(|pad| moved_ring(pad, place));
        let under = relief.under(
            [&rings[0], &rings[1]],
            &DAffine2::from_translation(-place),
            Jaws::Straight,
        );
        let deltas = Pads::new(&under).ok()?.deltas(force)?;
        Some(relief.with_deltas(deltas))
    }

    /// With the pressure of pads whose layers are compressed by `deltas` at the pads' planes.
    pub(super) fn pressed_by(
        pieces: [Vec<Piece>; 2],
        layer: Layer,
        force: f64,
        deltas: [f64; 2],
    ) -> Self {
        let pressed = Default::default();
        let pieces = shaped(pieces);
        Self { pieces, pressed, layer, force, deltas, flush: None }.with_deltas(deltas)
    }

    /// Planes and what lies beside them, not pressed yet.
    pub(super) fn beside(pieces: [Vec<Piece>; 2], layer: Layer, force: f64, flush: f64) -> Self {
        let (pieces, pressed) = (shaped(pieces), Default::default());
        Self { pieces, pressed, layer, force, deltas: [0.0; 2], flush: Some(flush) }
    }

    /// With the pressure of pads whose layers are compressed by `deltas` at the pads' planes.
    pub(super) fn with_deltas(self, deltas: [f64; 2]) -> Self {
        let counts = |piece: &Piece| self.is_round() || is_level(piece);
        let pressed = [0, 1].map(|side: usize| {
            let pieces = self.pieces[side].iter().map(|(piece, _)| piece);
            let pieces = pieces.filter(|piece| counts(piece));
            pieces.flat_map(|piece| pressed(piece, deltas[side])).collect()
        });
        Self { pressed, deltas, ..self }
    }

    /// As seen from another origin and turn.
    pub(super) fn moved(&self, origin: DVec2, turn: f64) -> Self {
        let map = DAffine2::from_angle(-turn) * DAffine2::from_translation(-origin);
        let pieces = shaped([0, 1].map(|side: usize| {
            let pieces = self.pieces[side].iter();
            pieces.map(|(piece, _)| moved(piece.polygon(), &piece.gap, &map)).collect()
        }));
        let pressed = [0, 1].map(|side: usize| {
            self.pressed[side].iter().map(|polygon| to_site(polygon, origin, turn)).collect()
        });
        Self { pieces, pressed, ..self.clone() }
    }

    /// What lies under pads with the outlines `rings` in the site's plane, as seen from the grip:
    /// `grip_from_site`, before the jaws are exchanged.
    fn under(&self, rings: [&[DVec2]; 2], grip_from_site: &DAffine2, jaws: Jaws) -> Surfaces {
        let map = match jaws {
            Jaws::Straight => *grip_from_site,
            Jaws::Exchanged => DAffine2::from_scale(DVec2::new(1.0, -1.0)) * *grip_from_site,
        };
        let under = |side: usize| -> Vec<Piece> {
            let mut under = Vec::new();
            for (piece, shape) in &self.pieces[side] {
                let mut give = |polygon| under.push(moved(polygon, &piece.gap, &map));
                shape.cut(piece, rings[side], &mut give);
            }
            under
        };
        let (face_i, face_ii) = match jaws {
            Jaws::Straight => (under(0), under(1)),
            Jaws::Exchanged => (under(1), under(0)),
        };
        let layer = (self.layer.thickness > 0.0).then_some(self.layer.thickness);
        Surfaces { face_i, face_ii, stiffness: [self.layer.stiffness; 2], layer }
    }

    /// What pads with the outlines `rings` (turned by `angle`, about the grip origin) touch at
    /// `place`, in the grip frame, and what of it is pressed without a load.
    pub(in crate::propose) fn touched(
        &self,
        rings: [&[DVec2]; 2],
        place: DVec2,
        angle: f64,
        jaws: Jaws,
    ) -> Surfaces {
        let rings = rings.map(|ring| moved_ring(ring, place));
        let map = DAffine2::from_angle(-angle) * DAffine2::from_translation(-place);
        self.under([&rings[0], &rings[1]], &map, jaws)
    }

    /// The outlines of what is pressed without a load of surfaces [`touched`](Self::touched); empty
    /// where nothing is.
    pub(in crate::propose) fn outlines(&self, surfaces: &Surfaces, jaws: Jaws) -> Contact {
        let near = match jaws {
            Jaws::Straight => self.deltas,
            Jaws::Exchanged => [self.deltas[1], self.deltas[0]],
        };
        let [k_i, k_ii] = surfaces.stiffness;
        if let Some(one) = Spot::of(&surfaces.face_i, k_i, self.force)
            && let Some(two) = Spot::of(&surfaces.face_ii, k_ii, self.force)
        {
            return Contact { face_i: vec![one.outline()], face_ii: vec![two.outline()] };
        }
        let Some([one, two]) = Pads::compressions(surfaces, self.force, near) else {
            return Contact::default();
        };
        let outline = |pieces: &[Piece], delta: f64| -> Patch {
            pieces.iter().flat_map(|piece| pressed(piece, delta)).collect()
        };
        Contact { face_i: outline(&surfaces.face_i, one), face_ii: outline(&surfaces.face_ii, two) }
    }

    /// Whether crests or leaning surface is gripped, not planes square to the closing direction.
    pub(in crate::propose) fn is_round(&self) -> bool {
        self.flush.is_none()
    }

    /// The contact of pads that rest on planes, where it is known without the layers: nothing where the
    /// planes are not touched on both sides, or all of what is touched is theirs.
    pub(in crate::propose) fn plain(&self, surfaces: &Surfaces) -> Option<Contact> {
        let flush = self.flush?;
        let sides = [&surfaces.face_i, &surfaces.face_ii];
        let is_own = |piece: &Piece| is_own(piece, flush);
        if sides.iter().any(|side| !side.iter().any(is_own)) {
            return Some(Contact::default());
        }
        let [face_i, face_ii] =
            sides.map(|side| -> Patch { side.iter().map(Piece::polygon).collect() });
        sides.iter().all(|side| side.iter().all(is_own)).then_some(Contact { face_i, face_ii })
    }

    /// Directions of the crests, in the site's `(x, y)`.
    fn crests(&self) -> impl Iterator<Item = DVec2> + '_ {
        self.pieces.iter().flatten().filter_map(|(piece, _)| match piece.gap {
            Gap::Cylinder { axis, .. } | Gap::Barrel { axis, .. } | Gap::Cone { axis, .. } => {
                Some(axis)
            }
            Gap::Plane { .. } | Gap::Sphere { .. } => None,
        })
    }

    /// Whether an edge of what is pressed is no edge of the part: along a crest.
    pub(super) fn runs_along(&self, edge: &Edge) -> bool {
        self.crests().any(|axis| edge.normal.dot(axis).abs() < 0.5 * axis.length())
    }

    /// Approach angles: along and across a crest; about a point, and where crests run in several
    /// directions, all round; and towards the middle of the cone asked for (its axis in the site's frame).
    pub(super) fn angles(&self, options: &ProposeOptions, cone: Option<DVec3>) -> Vec<f64> {
        let turn = std::f64::consts::TAU;
        let all_round = (turn / options.angle_step.max(POINT_STEP)).round().max(1.0) as usize;
        let (first, count) = match self.crests().next() {
            Some(axis) => {
                let first = axis.to_angle().rem_euclid(turn / 4.0);
                let is_across = |other: DVec2| {
                    let [one, other] = [axis, other].map(DVec2::normalize);
                    one.dot(other).abs().min(one.perp_dot(other).abs()) < IN_LINE
                };
                let count = if self.crests().all(is_across) { 4 } else { all_round.max(4) };
                // Rounding must not move it to the other end of the interval.
                (if first > turn / 4.0 - 1e-6 { 0.0 } else { first }, count)
            }
            None => (0.0, all_round),
        };
        let step = turn / count as f64;
        let mut angles: Vec<f64> = (0..count).map(|index| first + step * index as f64).collect();
        if let Some(towards) = cone.and_then(|axis| axis.truncate().try_normalize()) {
            let angle = towards.to_angle().rem_euclid(turn);
            let near = |known: &f64| {
                let apart = (angle - known).rem_euclid(turn);
                apart.min(turn - apart) < 2e-3
            };
            if !angles.iter().any(near) {
                angles.push(angle);
            }
        }
        angles
    }
}

fn moved_ring(ring: &[DVec2], by: DVec2) -> Ring {
    ring.iter().map(|&point| point + by).collect()
}

/// Pieces with what their outlines say.
fn shaped(pieces: [Vec<Piece>; 2]) -> [Vec<(Piece, Shape)>; 2] {
    let shaped = |piece: Piece| {
        let shape = Shape::of(&piece);
        (piece, shape)
    };
    pieces.map(|pieces| pieces.into_iter().map(shaped).collect())
}

fn moved(polygon: Polygon, gap: &Gap, map: &DAffine2) -> Piece {
    let Polygon { outer, holes } = polygon::transformed(polygon, map);
    Piece { outer, holes, gap: mapped(gap, map) }
}
