//! The paper's open problem (section 6): what a cylinder becomes when it is taken for a prism of
//! more and more plane faces.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::studies::FORCE;
use super::{Figure, draw, number, shapes};
use crate::contact::surface::{Gap, Piece, Surfaces};
use crate::error::Result;
use crate::mechanics::{self, Options, curved};
use crate::model::{Status, Wrench};

/// Radius and length of the cylinder \[m\]; its axis is `x1`.
pub const RADIUS: f64 = 0.01;
/// See [`RADIUS`].
pub const LENGTH: f64 = 0.04;
/// Stiffness of the pads for the cylinder [Pa/m]: so hard that it touches along a line 0.15 mm wide.
const STIFFNESS: f64 = 1e13;
/// Faces of the prisms.
pub const FACES: [u32; 6] = [6, 12, 24, 48, 96, 360];
/// Loads: name, force \[N\], moment [N m] about the axis.
const LOADS: [(&str, [f64; 3], [f64; 3]); 6] = [
    ("M1 0.3", [0.0; 3], [0.3, 0.0, 0.0]),
    ("M1 0.03", [0.0; 3], [0.03, 0.0, 0.0]),
    ("F1 30, M1 0.3", [30.0, 0.0, 0.0], [0.3, 0.0, 0.0]),
    ("F2 15, M1 0.15", [0.0, 15.0, 0.0], [0.15, 0.0, 0.0]),
    ("M3 0.3", [0.0; 3], [0.0, 0.0, 0.3]),
    ("M1 0.15, M3 0.15", [0.0; 3], [0.15, 0.0, 0.15]),
];

/// A load on the prisms and on the cylinder.
#[derive(Debug, Clone, PartialEq)]
pub struct PrismRow {
    /// The load.
    pub load: &'static str,
    /// `mu_s` of the two opposite faces of each prism of [`FACES`]; `None`: twisted out.
    pub prisms: Vec<Option<f64>>,
    /// `mu_s` of the cylinder.
    pub cylinder: f64,
}

/// Two opposite faces of a prism between plane pads against the cylinder with its spin.
///
/// # Errors
/// Never for these inputs; passed on from the solvers.
pub fn rows() -> Result<Vec<PrismRow>> {
    LOADS
        .iter()
        .map(|&(load, force, moment)| {
            let wrench =
                Wrench { force: DVec3::from_array(force), moment: DVec3::from_array(moment) };
            let prism = |n: u32| -> Result<Option<f64>> {
                let half = PI / f64::from(n);
                let face = shapes::rectangle(LENGTH, 2.0 * RADIUS * half.sin());
                let distance = 2.0 * RADIUS * half.cos();
                let options = Options::default();
                let contact = shapes::both(&face);
                let score = mechanics::solve(&contact, distance, FORCE, &wrench, &options)?;
                Ok(score.mu_s.filter(|_| score.status != Status::TwistedOut))
            };
            let gap =
                Gap::Cylinder { radius: RADIUS, axis: DVec2::X, at: DVec2::ZERO, height: 0.0 };
            let outer = shapes::rectangle(LENGTH, RADIUS).swap_remove(0).outer;
            let piece = vec![Piece { outer, holes: Vec::new(), gap }];
            let surfaces = Surfaces {
                face_i: piece.clone(),
                face_ii: piece,
                stiffness: [STIFFNESS; 2],
                ..Surfaces::default()
            };
            let answer = curved::solve(&surfaces, 2.0 * RADIUS, FORCE, &wrench)?;
            Ok(PrismRow {
                load,
                prisms: FACES.iter().map(|&n| prism(n)).collect::<Result<_>>()?,
                cylinder: answer.score.mu_s.unwrap_or(f64::NAN),
            })
        })
        .collect()
}

pub(super) fn figure() -> Result<Figure> {
    let rows = rows()?;
    let lost = rows.iter().filter(|row| row.prisms.last().is_some_and(Option::is_none)).count();
    let finding = format!(
        "Of {} loads, the finest prism loses {lost} that friction holds on the cylinder; the others come to it as 1/n^2.",
        rows.len()
    );
    let cell = |mu: Option<f64>| mu.map_or_else(|| "twisted_out".to_owned(), number);
    let table = rows.iter().map(|row| {
        std::iter::once(row.load.to_owned())
            .chain(row.prisms.iter().map(|mu| cell(*mu)))
            .chain([number(row.cylinder)])
            .collect()
    });
    Ok(Figure {
        name: "cylinder",
        title: "A cylinder taken for a prism of more and more faces",
        svg: draw::prisms(&rows)?,
        columns: vec!["load", "n_6", "n_12", "n_24", "n_48", "n_96", "n_360", "cylinder"],
        rows: table.collect(),
        finding,
    })
}
