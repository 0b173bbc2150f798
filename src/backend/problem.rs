//! What the bulk scorer is asked and what its seed stage answers.

use std::sync::Arc;

use glam::DVec3;

use crate::contact::Twist;
use crate::error::{Error, Result};
use crate::load::wrench_in_grip;
use crate::model::{Contact, Frame, LARGEST_SCALE, Wrench};

/// Relative widening of both bounds. The largest error of the 32-bit kernels seen so far is 2.1e-6
/// with 81 twists and 9.5e-6 with 321, both of an upper bound (`gripfast bench check` on up to 2,000
/// random contacts, software Vulkan; the processor's are alike). Vulkan allows a logarithm 5e-7 off.
pub const F32_TOLERANCE: f64 = 2e-5;

/// Largest share by which bounds are widened besides on a graphics processor, which makes its loads in
/// single precision from the list and the pose.
pub const LOAD_TOLERANCE: f64 = 5e-4;

/// One grip: its contact and the loads on it.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Contact areas in the grip frame. Problems that share the `Arc` share the work that depends
    /// on it alone.
    pub contact: &'a Arc<Contact>,
    /// Height of face I over face II \[m\], the `d` of the mechanics: negative for grips from inside
    /// ([`crate::model::Grip::distance`]).
    pub distance: f64,
    /// Gripping force \[N\].
    pub force: f64,
    /// Wrenches on the body: in the grip frame with moments about its origin, or as `pose` says.
    /// Problems that share the slice share what is made of it for a graphics processor.
    pub wrenches: &'a [Wrench],
    /// Where the grip is, when the wrenches are those on the part; `None`: they are in the grip
    /// frame.
    pub pose: Option<Pose>,
}

/// Where a grip is on the part that the loads act on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The point that the moments of the wrenches are about, part frame \[m\].
    pub centre_of_mass: DVec3,
    /// The grip frame in the part frame, in which the wrenches are.
    pub part_from_grip: Frame,
}

impl Problem<'_> {
    /// A load in the grip frame about its origin.
    #[inline]
    pub(super) fn wrench(&self, load: usize) -> Wrench {
        self.seen(&self.wrenches[load])
    }

    /// One of the wrenches in the grip frame about its origin.
    #[inline(always)]
    pub(super) fn seen(&self, wrench: &Wrench) -> Wrench {
        match &self.pose {
            None => *wrench,
            Some(pose) => wrench_in_grip(wrench, pose.centre_of_mass, &pose.part_from_grip),
        }
    }
}

/// Grips to seed in one call.
#[derive(Debug, Clone, Default)]
pub struct Batch<'a> {
    /// In the order of the answers.
    pub problems: Vec<Problem<'a>>,
}

/// What kind of seed a load got.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SeedStatus {
    /// Congruent faces in full contact: a twist and bounds on `mu_s`, which depends on the in-plane
    /// load alone.
    Bounded,
    /// Different faces in full contact: a twist, and bounds on `mu_s` that allow for all that the
    /// friction coupling can do.
    Coupled,
    /// A twist; no bounds.
    Unbounded,
    /// Coupled or separated contact: a twist, and what `mu_s` lies between by an estimate in single
    /// precision and all that it can be off.
    Estimated,
    /// No force in the pad plane and no moment about the closing axis.
    NoLoad,
    /// A contact area is empty.
    NoContact,
    /// `|F3| >= 2 Fn`.
    NoNormalForce,
}

/// Where to start solving for one load, and what is known of the answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seed {
    /// What kind of seed this is.
    pub status: SeedStatus,
    /// Twist of the body about the grip origin, in the sense that the load drives: [m/s, m/s,
    /// rad/s] up to a positive factor. Zero where nothing was searched.
    pub twist: Twist,
    /// `mu_s` is at least this (0 without bounds).
    pub lower: f64,
    /// `mu_s` is at most this (infinite without bounds).
    pub upper: f64,
    /// `mu_s` is about this: the best twist's value for the pressure without friction coupling,
    /// shortened to full contact. Not a bound; zero where nothing was searched.
    pub estimate: f64,
}

/// Refuses numbers that are not finite.
pub(crate) fn check(problem: &Problem<'_>, index: usize) -> Result<()> {
    check_grip(problem, index)?;
    let mut loads = problem.wrenches.iter().enumerate();
    loads.try_for_each(|(load, wrench)| check_load((load, &problem.seen(wrench)), index))
}

/// [`check`] of all but the loads.
pub(super) fn check_grip(problem: &Problem<'_>, index: usize) -> Result<()> {
    let place = || format!("grip {index}");
    if !(problem.force.is_finite() && problem.force > 0.0) {
        return Err(Error::input(
            place(),
            format!("gripping force {} N", problem.force),
            "give a positive force",
        ));
    }
    if problem.distance.is_nan() || problem.distance.abs() > LARGEST_SCALE {
        return Err(Error::input(
            place(),
            format!("distance between the faces {} m", problem.distance),
            "give a distance of at most 1e60 m",
        ));
    }
    if let Some(pose) = &problem.pose
        && !(pose.centre_of_mass.is_finite()
            && pose.part_from_grip.origin.is_finite()
            && pose.part_from_grip.rotation.is_finite())
    {
        return Err(Error::input(
            place(),
            "the pose is not finite",
            "give finite numbers for the frame and the centre of mass",
        ));
    }
    Ok(())
}

/// [`check`] of one load of the grip with this index.
pub(super) fn check_load((load, wrench): (usize, &Wrench), grip: usize) -> Result<()> {
    if wrench.force.is_finite() && wrench.moment.is_finite() {
        return Ok(());
    }
    Err(Error::input(
        format!("grip {grip}"),
        format!("load {load} is not finite: {wrench:?}"),
        "give finite forces and moments",
    ))
}
