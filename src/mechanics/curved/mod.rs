//! Contacts that are curved, drafted or stepped: pieces of surface with gaps under soft flat pads.
//!
//! The pressure is `k (delta - h + tilt)` where that is positive; it acts along the surface's
//! normal, so that a slope of the gap moves its lever (`xi = x - (d/2) grad h` in (6)(7)) and
//! pushes along the pad (`-p grad h` in (3)(4)). A part that is round about an axis on both faces
//! can spin about it, which friction alone resists: the slip problem then has four or five
//! dimensions. `docs/curved.md` says what is solved and what is neglected.

mod equilibrium;
mod face;
mod floor;
mod inverse;
mod joint;
mod limit;
mod note;
mod screen;
mod slip;
mod space;
mod turning;

use std::sync::OnceLock;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::contact::quadric::Quadratic;
use crate::contact::surface::{Field, Piece, Surfaces};
use crate::error::{Error, Result};
use crate::model::{Score, Status, Wrench, check_area};

use face::{Face, Pressed};
pub use inverse::force_needed;
use limit::{Asked, Case, Limit, no_answer};
pub use note::{LARGE_TILT, Note, SoftLimit};
pub use screen::{Compared, Screen};
use space::{Kind, Rotation};

/// What one face carries at the limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct FaceAnswer {
    /// Normal force \[N\].
    pub load: f64,
    /// Compression of the layer at the origin of the pad plane \[m\].
    pub delta: f64,
    /// Pressed area [m^2].
    pub area: f64,
    /// Mean pressure \[Pa\].
    pub mean_pressure: f64,
    /// Greatest pressure \[Pa\].
    pub greatest_pressure: f64,
    /// Greatest compression of the layer \[m\].
    #[serde(default)]
    pub compression: f64,
    /// Smallest box around what is pressed: its lower and upper corner in `(x1, x2)` \[m\].
    pub extent: [[f64; 2]; 2],
    /// What the face carries by friction: force along `x1`, `x2` \[N\] and moment about `x3` [N m].
    pub share: [f64; 3],
}

/// The answer for one contact of [`Surfaces`] and one load.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// Status, `mu_s`, certificate, as for planes; there are no pressure planes.
    #[serde(flatten)]
    pub score: Score,
    /// Dimensions of the slip problem: 3, 4 or 5.
    pub dimensions: u8,
    /// Incipient motion `(u1, u2, omega3, omega1, omega2)` of the point midway between the faces,
    /// the largest part 1 in m/s and rad/s.
    pub motion: Option<[f64; 5]>,
    /// Tilt of the body `(a1, a2)` \[rad\]: compression is `delta - h + a . x` on face I and `delta -
    /// h - a . x` on face II.
    pub tilt: Option<[f64; 2]>,
    /// Both faces.
    pub faces: Option<[FaceAnswer; 2]>,
    /// What to know beside.
    pub notes: Vec<Note>,
}

/// Smallest friction coefficient that holds `wrench` (about the grip origin) in a grip on these
/// surfaces, squeezed with `force` \[N\]. `distance` \[m\] is the height of face I's pad plane over
/// that of face II, negative for a grip from inside.
///
/// # Errors
/// When a number is not finite, `force` or a stiffness is not positive, or a gap is not a surface.
/// A hard case is a [`Status`].
pub fn solve(surfaces: &Surfaces, distance: f64, force: f64, wrench: &Wrench) -> Result<Answer> {
    check(surfaces, distance, force, wrench)?;
    Ok(Pads::ready(surfaces).solve(distance, force, wrench))
}

/// Both faces of a contact made ready for many loads.
#[derive(Debug, Clone)]
pub struct Pads {
    faces: [Face; 2],
    /// Smallest radius of the round pieces of each face, and the layer's thickness, for notes.
    radii: [Option<f64>; 2],
    layer: Option<f64>,
    /// Of the squeeze that was asked for first: its force, the distance, and what it says.
    squeezed: OnceLock<(f64, f64, [Rotation; 2])>,
}

/// A face pressed without a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Squeezed {
    /// Compression of the layer at the origin of the pad plane: pieces are pressed where their gap
    /// is less \[m\].
    pub delta: f64,
    /// Pressed area [m^2].
    pub area: f64,
    /// Mean pressure \[Pa\].
    pub mean_pressure: f64,
    /// Greatest pressure \[Pa\].
    pub greatest_pressure: f64,
}

impl Pads {
    /// From the pieces of both faces.
    ///
    /// # Errors
    /// As [`solve`].
    pub fn new(surfaces: &Surfaces) -> Result<Self> {
        check(surfaces, 0.0, 1.0, &Wrench::default())?;
        Ok(Self::ready(surfaces))
    }

    fn ready(surfaces: &Surfaces) -> Self {
        let pieces: [&[Piece]; 2] = [&surfaces.face_i, &surfaces.face_ii];
        let radius = |pieces: &[Piece]| {
            pieces.iter().filter_map(|piece| piece.gap.radius()).map(f64::abs).reduce(f64::min)
        };
        Self {
            faces: [
                Face::new(pieces[0].iter(), surfaces.stiffness[0], 1.0),
                Face::new(pieces[1].iter(), surfaces.stiffness[1], -1.0),
            ],
            radii: pieces.map(radius),
            layer: surfaces.layer,
            squeezed: OnceLock::new(),
        }
    }

    /// [`space::rotations`] under a squeeze with `force` \[N\] that presses the faces like this.
    fn rotations(&self, pressed: &[Pressed<'_>; 2], distance: f64, force: f64) -> [Rotation; 2] {
        let found = || space::rotations([&pressed[0], &pressed[1]], distance);
        let &(known_force, known_distance, known) =
            self.squeezed.get_or_init(|| (force, distance, found()));
        if known_force == force && known_distance == distance { known } else { found() }
    }

    /// Whether each face is one piece of a cylinder or a sphere: what is free under one squeeze is so
    /// under all.
    fn plainly_round(&self) -> bool {
        let round = |field: &Field| {
            let Quadratic { g, l, .. } = field.gap;
            g == DVec2::ZERO && l != DVec2::ZERO && (l.x == 0.0 || l.y == 0.0 || l.x == l.y)
        };
        self.faces.iter().all(|face| matches!(&face.fields[..], [field] if round(field)))
    }

    /// Distance of the farthest corner of the pieces from the grip origin \[m\].
    pub fn reach(&self) -> f64 {
        self.faces[0].reach().max(self.faces[1].reach())
    }

    /// As [`solve`]; numbers must be finite and `force` positive.
    pub fn solve(&self, distance: f64, force: f64, wrench: &Wrench) -> Answer {
        self.answer(distance, force, wrench, Asked::ALL)
    }

    /// As [`Self::solve`] with what the tilt moves, as grips are ranked: flats are pushed along the pads,
    /// round faces roll; the theory of [`solve`] leaves it out.
    pub fn solve_pushed(&self, distance: f64, force: f64, wrench: &Wrench) -> Answer {
        self.answer(distance, force, wrench, Asked { moves: true, ..Asked::ALL })
    }

    /// As [`Self::solve_pushed`] for a load whose status is known: where that is `ok` there is no other limit
    /// state to look for.
    pub(crate) fn solve_again(
        &self,
        distance: f64,
        force: f64,
        wrench: &Wrench,
        status: Status,
    ) -> Answer {
        self.answer(
            distance,
            force,
            wrench,
            Asked { others: status != Status::Ok, notes: true, moves: true },
        )
    }

    /// As [`Self::score`], without a look for other limit states where there is one: only the status
    /// may differ, `ok` for `ambiguous`.
    pub(crate) fn score_first(&self, distance: f64, force: f64, wrench: &Wrench) -> Score {
        self.answer(distance, force, wrench, Asked::FIRST).score
    }

    /// As [`Self::solve_pushed`] without notes.
    pub fn score(&self, distance: f64, force: f64, wrench: &Wrench) -> Score {
        self.answer(distance, force, wrench, Asked::SCORE).score
    }

    fn answer(&self, distance: f64, force: f64, wrench: &Wrench, asked: Asked) -> Answer {
        let solved = |case: Case<'_, '_>| {
            let mut answer = case.solve();
            if asked.notes {
                answer.notes.extend(case.softness(self, &answer));
            }
            answer
        };
        self.with_case(distance, force, wrench, asked, solved).unwrap_or_else(no_answer)
    }

    /// The limit state next to that under another force, without one the first of all; `None` where there
    /// is none.
    fn limit<'a>(
        &'a self,
        distance: f64,
        force: f64,
        wrench: &Wrench,
        near: Option<&Limit<'a>>,
    ) -> Option<Limit<'a>> {
        let found = |case: Case<'a, '_>| Case { near, ..case }.limit();
        self.with_case(distance, force, wrench, Asked::FIRST, found).ok()
    }

    /// Gives `solve` a load with both faces pressed, or the status where there is nothing to solve.
    fn with_case<'a, T>(
        &'a self,
        distance: f64,
        force: f64,
        wrench: &Wrench,
        asked: Asked,
        solve: impl FnOnce(Case<'a, '_>) -> T,
    ) -> std::result::Result<T, Status> {
        if self.faces.iter().any(|face| face.fields.is_empty()) {
            return Err(Status::NoContact);
        }
        let normal = [force + 0.5 * wrench.force.z, force - 0.5 * wrench.force.z];
        if normal.iter().any(|n| *n <= 0.0) {
            return Err(Status::NoNormalForce);
        }
        let pressed = [0, 1].map(|k| self.faces[k].carry(normal[k], DVec2::ZERO, None));
        let [Some(one), Some(two)] = &pressed else { return Err(Status::NotConverged) };
        let rotations = space::rotations([one, two], distance);
        let (faces, pressed, near) = (&self.faces, [one, two], None);
        Ok(solve(Case { faces, pressed, distance, normal, wrench, rotations, asked, near }))
    }

    /// Both faces squeezed with `force` \[N\] without a load; `None` without contact.
    pub fn squeezed(&self, force: f64) -> Option<[Squeezed; 2]> {
        let squeezed = |face: &Face| {
            let (delta, regions) = face.squeezed(force)?;
            let area = regions.iter().map(|region| region.area_and_load().0).sum::<f64>();
            Some(Squeezed {
                delta,
                area,
                mean_pressure: force / area,
                greatest_pressure: face.greatest(&regions),
            })
        };
        Some([squeezed(&self.faces[0])?, squeezed(&self.faces[1])?])
    }

    /// Compressions at the pads' planes \[m\], as [`Self::squeezed`] tells.
    pub(crate) fn deltas(&self, force: f64) -> Option<[f64; 2]> {
        let [one, two] = &self.faces;
        let first = one.squeeze(force)?;
        // Under pads alike on a part that is the same on both sides.
        let is_same = one.fields == two.fields && one.stiffness == two.stiffness;
        Some([first, if is_same { first } else { two.squeeze(force)? }])
    }

    /// Greatest compression of either face at compressions `deltas` of the pads' planes \[m\].
    pub(crate) fn compressed(&self, deltas: [f64; 2]) -> f64 {
        self.faces[0].compressed(deltas[0]).max(self.faces[1].compressed(deltas[1]))
    }

    /// Compressions at the planes of pads on sound surfaces \[m\] under a squeeze with `force` \[N\], looked
    /// for from `near` on; `None` without contact.
    pub(crate) fn compressions(
        surfaces: &Surfaces,
        force: f64,
        near: [f64; 2],
    ) -> Option<[f64; 2]> {
        let of = |side: usize| {
            let pieces = [&surfaces.face_i, &surfaces.face_ii][side];
            face::compression(pieces, surfaces.stiffness[side], force, near[side])
        };
        Some([of(0)?, of(1)?])
    }

    /// Axes in the pad plane about which the part can turn without any change of the pressure, at a
    /// squeeze with `force` \[N\]: none, one or two unit vectors.
    pub fn free_axes(&self, distance: f64, force: f64) -> Vec<DVec2> {
        let pressed = [0, 1].map(|k| self.faces[k].carry(force, DVec2::ZERO, None));
        let [Some(one), Some(two)] = pressed else { return Vec::new() };
        let free = |rotation: &Rotation| matches!(rotation.kind, Kind::Free | Kind::Facets(_));
        let rotations = self.rotations(&[one, two], distance, force);
        rotations.iter().filter(|rotation| free(rotation)).map(|rotation| rotation.axis).collect()
    }
}

fn check(surfaces: &Surfaces, distance: f64, force: f64, wrench: &Wrench) -> Result<()> {
    super::solve::check_numbers(distance, force, wrench)?;
    for (name, pieces) in [("A_I", &surfaces.face_i), ("A_II", &surfaces.face_ii)] {
        let rings = || pieces.iter().flat_map(|piece| piece.holes.iter().chain([&piece.outer]));
        check_area(rings, || name.to_owned())?;
        for (index, piece) in pieces.iter().enumerate() {
            if let Some(fault) = piece.gap.fault() {
                return Err(Error::input(
                    format!("{name}[{index}].gap"),
                    format!("has {fault}"),
                    "give finite lengths [m], radii that are not zero, axes that are not zero",
                ));
            }
        }
    }
    let [one, two] = surfaces.stiffness;
    if !(one.is_finite() && one > 0.0 && two.is_finite() && two > 0.0) {
        return Err(Error::input(
            "k",
            format!("is [{one}, {two}]"),
            "give the pads' stiffness on face I and II, finite and positive [Pa/m]",
        ));
    }
    if let Some(layer) = surfaces.layer
        && !(layer.is_finite() && layer > 0.0)
    {
        return Err(Error::input(
            "layer",
            format!("is {layer}"),
            "give the thickness of the pads' layer, finite and positive [m]",
        ));
    }
    Ok(())
}
