//! Finds and ranks every two-finger grip (grasp) on a CAD part by the smallest friction coefficient
//! that holds it.
//!
//! # The main job
//!
//! ```
//! use gripfast::plan::Plan;
//! use gripfast::request::Request;
//! use gripfast::units::{Density, Length};
//!
//! let mut request = Request::new("data/parts/hex_nut.stl", "generic");
//! request.density = Some(Density(7850.0));
//! request.candidates.spacing = Some(Length(0.006));
//! let outcome = Plan::new(request)?.run(&mut (), &false.into())?;
//! let best = &outcome.set.grips[0];
//! println!("mu_s {:?} at {:?}", best.worst.mu_s, best.grip.part_from_grip.origin);
//! # assert!(best.worst.mu_s.is_some_and(|mu| mu > 0.0 && mu < 1.0));
//! # Ok::<(), gripfast::error::Error>(())
//! ```
//!
//! # A tour
//!
//! Everything is in SI units and right-handed frames; quantities with units ([`units`]) stand at
//! the edge only. Bad input is an [`error::Error`] with a kind, a place and a remedy; a hard grip is
//! a [`model::Status`].
//!
//! | for | go to |
//! |---|---|
//! | the whole job: part, gripper and loads in, ranked grips out | [`plan::Plan`], asked by a [`request::Request`] |
//! | what comes out, and reading it again | [`results::GripSet`], [`export`], [`report`] |
//! | one contact pair under one load, certified | [`mechanics::solve`] |
//! | many contact pairs under many loads, on processor or GPU | [`backend::Backend::score`] |
//! | a part: mesh, health, mass, planar faces | [`part::Part`] |
//! | candidate grips without scores; why a pose is none | [`propose::Proposer`] |
//! | load cases: gravity, accelerations, lists, trajectories | [`load::LoadSet`] |
//! | a gripper: files, checks, the catalogue | [`gripper::Gripper`] |
//! | many parts, grippers and load sets; nothing lost | [`batch::run`] |
//! | the order of grips of one's own | [`rank::rank`] |
//! | the first grip that is free in a scene | [`pick::Picker`] |
//! | the paper's own method and figures | [`lab`] |
//!
//! The folder `examples/` plans a part, scores contacts of one's own, and brings loads and a gripper
//! of one's own. `ARCHITECTURE.md` shows the pipeline and which module may import which.
//!
//! # Symbols
//!
//! Those of J. Barber, R. A. Volz and others, *Automatic Two-Fingered Grip Selection* (1986), whose
//! equation numbers are kept. Grip frame: origin midway between the pads, `x1` the approach axis,
//! `x3` the closing axis, `x2 = x3 x x1`.
//!
//! | symbol | name here | unit | equation |
//! |---|---|---|---|
//! | `mu_s` | [`model::Score::mu_s`]: smallest friction coefficient that holds | 1 | (3)-(9) |
//! | `F1, F2, F3` | [`model::Wrench::force`] on the body | N | (3)(4)(8) |
//! | `M1, M2, M3` | [`model::Wrench::moment`] on the body, about the grip origin | N m | (5)(6)(7) |
//! | `Fn` | gripping force, the mean of the two normal forces | N | (9) |
//! | `N_I, N_II` | normal forces `Fn + F3/2`, `Fn - F3/2` | N | (8)(9) |
//! | `d` | [`model::Grip::distance`]: height of face I over face II | m | (6)(7) |
//! | `A_I, A_II` | [`model::Contact::face_i`], [`model::Contact::face_ii`]: contact areas | m | 3.5 |
//! | `p_I, p_II` | pressure on a face, [`model::Pressure`] | Pa | (1)(2)(19)(20) |
//! | `a_I0, a_II0` | [`model::Pressure::a_i0`], [`model::Pressure::a_ii0`] | Pa | (1)(2) |
//! | `a_1, a_2` | slopes of the pressure, [`model::Pressure::a1`], [`model::Pressure::a2`] | Pa/m | (1)(2) |
//! | `c` | slip centre, [`model::Slip::Rotation`] | m | (3)-(7) |
//! | `v = (u1, u2, omega)` | twist of the body in the pad plane; `c = (-u2, u1)/omega` | m/s, rad/s | |
//! | `D(v)` | dissipation of a twist per unit of friction, a norm | W | |
//! | `w = (F1, F2, M3)` | the load in the pad plane; `mu_s = max (w.v)/D(v)` | N, N m | (3)(4)(5) |
//! | `E` | the paper's error figure, [`lab::paper`] | | (17)(18) |
//! | `alpha` | [`results::RankedGrip::alpha`]: tilt that closing jaws still right | rad | 5.3 |
//! | `Delta_d` | [`results::RankedGrip::delta_d`]: opening that twists the part out | m | 2 |
//! | `k1, k2` | [`rank::Weights`] of the score `k1/mu_s + k2 alpha` | 1, 1/rad | 5.3 |

/// A method for each option that sets it: `Options::default().with_top(Some(10))`.
macro_rules! setters {
    ($type:ty { $($with:ident: $field:ident: $value:ty),+ $(,)? }) => {
        impl $type {$(
            #[doc = concat!("The same with this `", stringify!($field), "`.")]
            #[must_use]
            pub fn $with(mut self, $field: $value) -> Self {
                self.$field = $field;
                self
            }
        )+}
    };
}

/// Vectors and matrices of this crate's interface, in the version that it uses.
pub use glam;

pub mod backend;
pub mod batch;
pub mod case;
pub(crate) mod clash;
#[doc(hidden)] // the integrals: tests and benches look at them
pub mod contact;
pub mod error;
pub mod export;
#[doc(hidden)] // for the program
pub mod file;
pub mod geometry;
pub mod gripper;
pub mod lab;
pub mod load;
pub mod mechanics;
pub mod memory;
pub mod model;
pub mod part;
pub mod pick;
pub mod plan;
pub mod poses;
pub mod propose;
pub mod rank;
pub mod report;
pub mod request;
pub mod results;
pub mod scene;
pub(crate) mod svg;
#[doc(hidden)] // for the program
pub mod text;
pub mod units;
