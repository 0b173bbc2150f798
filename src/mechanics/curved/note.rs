//! What to know beside the numbers of a contact that is not plane.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::model::Face as Side;

/// Tilt up to which the equations for small ones were seen to be right within 1.5 % \[rad\].
pub const LARGE_TILT: f64 = 0.1;

/// What a user should know beside the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "note", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Note {
    /// The pad is too soft or its contact too wide for the flat formula.
    TooSoft {
        /// The face.
        face: Side,
        /// Which limit is passed.
        limit: SoftLimit,
        /// The value: compression or half width over the layer's thickness, or half width over
        /// radius.
        value: f64,
    },
    /// The part rolls out of the grip unless friction holds it: its round faces stand farther
    /// apart than their radii.
    Unstable {
        /// Stiffness against the rotation [N m per rad], negative.
        stiffness: f64,
    },
    /// A pad ends within the contact of a part that can spin, and pushes it off sideways.
    OverEdge {
        /// Force on the body across the axis \[N\].
        force: f64,
    },
    /// The part turns by this angle before it stops, more than the layers give: the rotation is
    /// counted as free.
    SettlesBy {
        /// Angle \[rad\].
        angle: f64,
    },
    /// The faces are of facets that could be meant to be round: they are taken as round.
    FacetedOrRound {
        /// Facets of the whole round.
        facets: f64,
    },
    /// The part tilts by this angle and slips by half the distance times it before the limit is
    /// there: friction may hold a little below the limit.
    TiltsFirst {
        /// Angle \[rad\].
        angle: f64,
        /// Slip \[m\].
        slip: f64,
    },
    /// What tilts under the load is pushed along the pads where it is plane, and rolls where it is round:
    /// left out as in the paper. Between two planes, and two round faces, it cancels.
    TiltPushes {
        /// Force on the body along `x1`, `x2` \[N\].
        force: [f64; 2],
        /// `mu_s` with it; `None` where there is no limit state then.
        mu_s: Option<f64>,
    },
    /// The same where it is counted and changes `mu_s` by over a hundredth.
    TiltPushesMuch {
        /// Force on the body along `x1`, `x2` \[N\].
        force: [f64; 2],
        /// `mu_s` without it; `None` where there is no limit state then.
        without: Option<f64>,
    },
}

/// Limits of [`Note::TooSoft`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SoftLimit {
    /// Compression above a third of the layer.
    Compression,
    /// Half width above 0.4 of the radius: friction needed is overestimated by over 1.6 %.
    Width,
    /// Half width below the layer's thickness: the layer is no bed of springs there.
    Thickness,
}

impl fmt::Display for Note {
    /// In words, for users.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm = 1e3;
        match *self {
            Self::TooSoft { face, limit, value } => {
                write!(out, "pad {face:?} is too soft for the theory: it ")?;
                match limit {
                    SoftLimit::Compression => {
                        write!(out, "is compressed by {:.0} % of its thickness", 100.0 * value)
                    }
                    SoftLimit::Width => write!(
                        out,
                        "touches {value:.2} radii to either side; mu_s is over 1.6 % too high"
                    ),
                    SoftLimit::Thickness => write!(
                        out,
                        "touches {value:.2} of its thickness to either side; it is no bed of \
                         springs"
                    ),
                }
            }
            Self::Unstable { stiffness } => write!(
                out,
                "unstable: the round faces stand farther apart than their radii; the part rolls \
                 out unless friction holds it ({stiffness:.4} N m per rad)"
            ),
            Self::OverEdge { force } => write!(
                out,
                "unstable: a pad ends within the contact and pushes the part aside with {:.4} N",
                force.abs()
            ),
            Self::SettlesBy { angle } => write!(
                out,
                "the faces are nearly on one axis: without friction the part settles by {:.3} \
                 deg; the rotation is counted as free",
                angle.to_degrees()
            ),
            Self::FacetedOrRound { facets } => write!(
                out,
                "faceted or round? about {facets:.0} facets to the round are taken as round"
            ),
            Self::TiltsFirst { angle, slip } => {
                write!(
                    out,
                    "the part tilts by {:.3} deg and slips {:.3} mm first; less friction than mu_s may \
                     hold",
                    angle.to_degrees(),
                    slip * mm
                )?;
                if angle > LARGE_TILT {
                    write!(out, "; so large a tilt is beyond the theory")
                } else {
                    Ok(())
                }
            }
            Self::TiltPushes { force, mu_s } => {
                write!(out, "{}, which mu_s leaves out; with it {}", tilts(force), or_none(mu_s))
            }
            Self::TiltPushesMuch { force, without } => {
                write!(out, "{}, which mu_s counts; without it {}", tilts(force), or_none(without))
            }
        }
    }
}

fn tilts([x, y]: [f64; 2]) -> String {
    format!(
        "the part tilts: its flat pushes ({x:.4}, {y:.4}) N along the pads, its round face rolls"
    )
}

fn or_none(mu: Option<f64>) -> String {
    mu.map_or_else(|| "no friction holds the load".to_owned(), |mu| format!("{mu:.6}"))
}
