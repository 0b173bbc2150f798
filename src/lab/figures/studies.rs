//! The numbers behind the figures: each study of the paper's section 5 and its figure 4, computed
//! again.

use glam::{DVec2, DVec3};

use super::shapes;
use crate::contact::{Loops, moments};
use crate::error::Result;
use crate::lab::earlier;
use crate::mechanics::pressure::{face_pressure, stiffness};
use crate::mechanics::twist_out::TwistOut;
use crate::mechanics::{self, Options, Pads};
use crate::model::{Contact, Patch, Score, Status, Wrench};

/// Side of the square that all contact shapes are inscribed in \[m\].
pub const SIDE: f64 = 0.02;
/// Gripping force \[N\].
pub const FORCE: f64 = 50.0;

fn solve(contact: &Contact, distance: f64, force: [f64; 3], moment: [f64; 3]) -> Result<Score> {
    let wrench = Wrench { force: DVec3::from_array(force), moment: DVec3::from_array(moment) };
    mechanics::solve(contact, distance, FORCE, &wrench, &Options::default())
}

/// A contact shape under a moment about the closing axis (figure 5).
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeRow {
    /// `square`, `hollow` or `cross`.
    pub shape: &'static str,
    /// Side of the hole, or width of the arms, over the side of the square.
    pub parameter: f64,
    /// Area over the square's.
    pub area_share: f64,
    /// Smallest friction coefficient under [`SHAPE_MOMENT`].
    pub mu_s: f64,
    /// The same over the full square's.
    pub ratio: f64,
}

/// Moment about the closing axis in figure 5 [N m]; `mu_s` is proportional to it.
pub const SHAPE_MOMENT: f64 = 0.2;

/// Figure 5: a square, hollow squares and crosses under a moment about the closing axis.
///
/// # Errors
/// Never for these inputs; passed on from [`mechanics::solve`].
pub fn figure_5() -> Result<Vec<ShapeRow>> {
    let row = |shape, parameter, patch: Patch| -> Result<ShapeRow> {
        let score = solve(&shapes::both(&patch), SIDE, [0.0; 3], [0.0, 0.0, SHAPE_MOMENT])?;
        Ok(ShapeRow {
            shape,
            parameter,
            area_share: score.contact_area_i / (SIDE * SIDE),
            mu_s: score.mu_s.unwrap_or(f64::NAN),
            ratio: 1.0,
        })
    };
    let mut rows = vec![row("square", 0.0, shapes::square(SIDE))?];
    let mut shares: Vec<f64> = (1..=19).map(|i| f64::from(i) / 20.0).chain([1.0 / 3.0]).collect();
    shares.sort_by(f64::total_cmp);
    for &share in &shares {
        rows.push(row("hollow", share, shapes::hollow(SIDE, share))?);
    }
    for &share in &shares {
        rows.push(row("cross", share, shapes::cross(SIDE, share))?);
    }
    let square = rows[0].mu_s;
    rows.iter_mut().for_each(|row| row.ratio = row.mu_s / square);
    Ok(rows)
}

/// A horizontal bar gripped at a distance from its centre of mass (figure 6).
#[derive(Debug, Clone, PartialEq)]
pub struct BarRow {
    /// Distance of the grip from the centre of mass \[m\].
    pub distance: f64,
    /// `mu_s` with the true slip centre.
    pub new: f64,
    /// `mu_s` with the slip centre at the centroid.
    pub old: f64,
}

/// Mass of the bar of figure 6 \[kg\].
pub const BAR_MASS: f64 = 0.5;
/// Round value of gravity for figure 6 [m/s^2].
const GRAVITY: f64 = 9.81;

/// Figure 6: a 0.5 kg bar held by square pads, its weight in the pad plane.
///
/// # Errors
/// As [`figure_5`].
pub fn figure_6() -> Result<Vec<BarRow>> {
    let contact = shapes::both(&shapes::square(SIDE));
    let weight = BAR_MASS * GRAVITY;
    let row = |distance: f64| -> Result<BarRow> {
        let (force, moment) = ([0.0, -weight, 0.0], [0.0, 0.0, -weight * distance]);
        let wrench = Wrench { force: DVec3::from_array(force), moment: DVec3::from_array(moment) };
        let old = earlier::solve(&contact, SIDE, FORCE, &wrench)?;
        Ok(BarRow {
            distance,
            new: solve(&contact, SIDE, force, moment)?.mu_s.unwrap_or(f64::NAN),
            old: old.mu_s.unwrap_or(f64::NAN),
        })
    };
    (0..=200).map(|i| row(5e-4 * f64::from(i))).collect()
}

/// The line at which a pad separates, turned by the moment about the closing axis (figure 4).
#[derive(Debug, Clone, PartialEq)]
pub struct LineRow {
    /// Moment about the closing axis [N m].
    pub moment: f64,
    /// Angle of face I's zero-pressure line from the axis of the out-of-plane moment \[rad\].
    pub angle: f64,
    /// Pressure coefficients of face I, `p = a0 + a1 x1 + a2 x2` [Pa, Pa/m].
    pub pressure: [f64; 3],
    /// Smallest friction coefficient.
    pub mu_s: f64,
    /// Share of the pad still in contact.
    pub contact_share: f64,
}

/// Share of the twist-out limit in figure 4.
pub const LINE_SHARE: f64 = 0.6;

/// Figure 4: square pads one side apart under `M1` = 0.6 of twist-out and a growing `M3`.
///
/// # Errors
/// As [`figure_5`].
pub fn figure_4() -> Result<Vec<LineRow>> {
    let contact = shapes::both(&shapes::square(SIDE));
    let mut rows = Vec::new();
    for moment in [
        0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7,
        0.75, 0.8,
    ] {
        let score = solve(&contact, SIDE, [0.0; 3], [LINE_SHARE * FORCE * SIDE, 0.0, moment])?;
        let (Some(mu_s), Some(p)) = (score.mu_s, score.pressure) else { continue };
        rows.push(LineRow {
            moment,
            angle: p.a1.abs().atan2(p.a2.abs()),
            pressure: [p.a_i0, p.a1, p.a2],
            mu_s,
            contact_share: score.contact_area_i / (SIDE * SIDE),
        });
    }
    Ok(rows)
}

/// What a sweep of the distance between the faces does to `mu_s`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trend {
    /// Does not change it.
    Constant,
    /// Raises it.
    Up,
    /// Lowers it.
    Down,
    /// Both, at different distances.
    Mixed,
}

/// One sweep of the distance between the faces under a fixed load (paper 5.1).
#[derive(Debug, Clone, PartialEq)]
pub struct DistanceSweep {
    /// Contact shape.
    pub shape: &'static str,
    /// Out-of-plane moment over the one that twists the part out.
    pub moment_share: f64,
    /// The load in the pad plane.
    pub load: &'static str,
    /// Distance over the side, `mu_s`, share of the smaller contact; ends where no limit state
    /// exists.
    pub points: Vec<[f64; 3]>,
    /// What happened to `mu_s`.
    pub trend: Trend,
    /// Distances at which another limit state exists or could not be excluded.
    pub ambiguous: usize,
    /// Largest residual of the seven equations at any distance.
    pub residual: f64,
}

/// Loads in the pad plane of the sweeps: name, `F1`, `F2` \[N\], `M3` [N m].
const IN_PLANE: [(&str, [f64; 3]); 6] = [
    ("M3", [0.0, 0.0, 0.1]),
    ("F1", [10.0, 0.0, 0.0]),
    ("F2", [0.0, 10.0, 0.0]),
    ("F1 M3", [10.0, 0.0, 0.1]),
    ("F2 M3", [0.0, 10.0, 0.1]),
    ("F1 F2 M3", [7.0, -7.0, 0.1]),
];

/// Relative change that counts as a change.
const CHANGE: f64 = 1e-9;

/// Paper 5.1: 108 sweeps of the distance between the faces from 0 to 5 sides: six shapes,
/// out-of-plane moments about `x1` of 0.25, 0.5 and 0.75 of twist-out, six loads in the pad plane
/// about the area's centroid.
///
/// # Errors
/// As [`figure_5`].
pub fn distance_sweeps() -> Result<Vec<DistanceSweep>> {
    let mut sweeps = Vec::new();
    for (shape, patch) in shapes::all(SIDE) {
        let contact = centred(&patch);
        for moment_share in [0.25, 0.5, 0.75] {
            let m1 = moment_share * twist_out_moment(&contact, DVec2::new(0.0, 1.0));
            for (load, [f1, f2, m3]) in IN_PLANE {
                let mut points = Vec::new();
                let (mut ambiguous, mut residual) = (0, 0.0_f64);
                for i in 0..=25 {
                    let ratio = 0.2 * f64::from(i);
                    let score = solve(&contact, ratio * SIDE, [f1, f2, 0.0], [m1, 0.0, m3])?;
                    let Some(mu_s) = score.mu_s else { break };
                    ambiguous += usize::from(score.status == Status::Ambiguous);
                    residual = residual.max(score.residual);
                    points.push([
                        ratio,
                        mu_s,
                        score.contact_area_i.min(score.contact_area_ii) / area(&patch),
                    ]);
                }
                sweeps.push(DistanceSweep {
                    shape,
                    moment_share,
                    load,
                    trend: trend(&points),
                    points,
                    ambiguous,
                    residual,
                });
            }
        }
    }
    Ok(sweeps)
}

fn trend(points: &[[f64; 3]]) -> Trend {
    let changes = || points.windows(2).map(|pair| pair[1][1] / pair[0][1] - 1.0);
    match (changes().any(|change| change > CHANGE), changes().any(|change| change < -CHANGE)) {
        (false, false) => Trend::Constant,
        (true, false) => Trend::Up,
        (false, true) => Trend::Down,
        (true, true) => Trend::Mixed,
    }
}

/// Contact left under an out-of-plane moment alone (paper 3.6).
#[derive(Debug, Clone, PartialEq)]
pub struct SeparationSweep {
    /// Contact shape.
    pub shape: &'static str,
    /// Direction in the pad plane in which the pressure resultants are displaced \[rad\].
    pub direction: f64,
    /// Moment over the one that twists the part out, share of the smaller contact, rounds of the
    /// paper's iteration.
    pub points: Vec<(f64, f64, u32)>,
}

/// Moments of the separation sweeps, over twist-out.
const MOMENT_SHARES: [f64; 14] =
    [0.1, 0.2, 0.3, 0.34, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999];

/// Paper 3.6: 30 sweeps of an out-of-plane moment up to twist-out, six shapes in five directions,
/// with the number of rounds that the paper's iteration (solve, clip at the zero-pressure line,
/// solve again) takes to settle.
///
/// # Errors
/// As [`figure_5`].
pub fn separation_sweeps() -> Result<Vec<SeparationSweep>> {
    let mut sweeps = Vec::new();
    for (shape, patch) in shapes::all(SIDE) {
        let contact = centred(&patch);
        let Some(pads) = Pads::new(&contact) else { continue };
        for direction in [0.0, 0.4, 0.8, 1.2, 2.2] {
            let e = DVec2::from_angle(direction);
            let limit = twist_out_moment(&contact, e);
            let mut points = Vec::new();
            for share in MOMENT_SHARES {
                let q = share * limit * e;
                let score = solve(&contact, SIDE, [0.0; 3], [q.y, -q.x, 0.0])?;
                let left = score.contact_area_i.min(score.contact_area_ii) / area(&patch);
                points.push((share, left, clip_and_solve(&pads, q / (FORCE * pads.length))));
            }
            sweeps.push(SeparationSweep { shape, direction, points });
        }
    }
    Ok(sweeps)
}

/// Rounds of the paper's iteration for the scaled moment `target`, until the pressure stays to
/// 1e-10.
fn clip_and_solve(pads: &Pads, target: DVec2) -> u32 {
    let wanted = nalgebra::Vector4::new(1.0, 1.0, target.x, target.y);
    let mut areas = pads.areas.clone();
    let mut before = nalgebra::Vector4::zeros();
    for round in 1..=1000 {
        let Some(q) = stiffness(&areas.each_ref().map(moments)).lu().solve(&wanted) else {
            return round;
        };
        if (q - before).amax() <= 1e-10 * q.amax() {
            return round;
        }
        before = q;
        for k in 0..2 {
            let mut next = Loops::default();
            pads.areas[k].clip_into(face_pressure(&q.into(), k), &mut next);
            areas[k] = next;
        }
    }
    1000
}

/// The shape on both faces, moved so that its centroid is the origin.
fn centred(patch: &Patch) -> Contact {
    let m = moments(&Loops::new(patch));
    let centroid = DVec2::new(m[1], m[2]) / m[0];
    let mut patch = patch.clone();
    for point in patch
        .iter_mut()
        .flat_map(|polygon| std::iter::once(&mut polygon.outer).chain(&mut polygon.holes))
        .flatten()
    {
        *point -= centroid;
    }
    shapes::both(&patch)
}

fn area(patch: &Patch) -> f64 {
    moments(&Loops::new(patch))[0]
}

/// The moment [N m] that displaces the pressure resultants along `e` as far as the pads reach.
fn twist_out_moment(contact: &Contact, e: DVec2) -> f64 {
    let unit = Wrench { force: DVec3::ZERO, moment: DVec3::new(e.y, -e.x, 0.0) };
    1.0 / (1.0 - TwistOut::new(contact).margin(FORCE, &unit))
}
