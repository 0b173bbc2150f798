//! Planes beside which the pads press other surface too: low steps, gentle slopes.

use std::sync::atomic::AtomicBool;

use glam::DVec3;
use gripfast::geometry::patch_area;
use gripfast::model::{Frame, LoadCase, Wrench};
use gripfast::part::Part;
use gripfast::plan::Plan;
use gripfast::request::{Choice, Request};
use gripfast::results::{GripSet, RankedGrip};
use gripfast::units::{Angle, Force, Length, Mass};

const FORCE: f64 = 100.0;
/// Pressure per compression of the gripper's pads [Pa/m].
const STIFFNESS: f64 = 5e9;

/// A bar of 20 mm depth about `z = 0` on the plane `y = 0`, under a chain of `(x, y)` by rising `x`
/// \[mm\].
fn bar(top: &[[f64; 2]]) -> Part {
    let corner = |k: usize, high: bool, front: bool| {
        let [x, y] = top[k];
        DVec3::new(x, if high { y } else { 0.0 }, if front { 10.0 } else { -10.0 }) * 1e-3
    };
    let mut soup: Vec<DVec3> = Vec::new();
    let mut quad = |[a, b, c, d]: [DVec3; 4]| soup.extend([a, b, c, a, c, d]);
    for k in 0..top.len() - 1 {
        let n = k + 1;
        quad([
            corner(k, false, true),
            corner(n, false, true),
            corner(n, true, true),
            corner(k, true, true),
        ]);
        quad([
            corner(n, false, false),
            corner(k, false, false),
            corner(k, true, false),
            corner(n, true, false),
        ]);
        quad([
            corner(k, true, true),
            corner(n, true, true),
            corner(n, true, false),
            corner(k, true, false),
        ]);
        quad([
            corner(k, false, false),
            corner(n, false, false),
            corner(n, false, true),
            corner(k, false, true),
        ]);
    }
    let last = top.len() - 1;
    quad([
        corner(0, false, false),
        corner(0, false, true),
        corner(0, true, true),
        corner(0, true, false),
    ]);
    quad([
        corner(last, false, true),
        corner(last, false, false),
        corner(last, true, false),
        corner(last, true, true),
    ]);
    let triangles: Vec<[u32; 3]> =
        (0..soup.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let part = Part::from_triangles("bar", &soup, &triangles).unwrap();
    assert!(part.health.watertight && part.mass_properties(1.0).volume > 0.0);
    part
}

/// 60 mm long and 20 mm high, its right half lower by `step` \[mm\].
fn stepped(step: f64) -> Part {
    bar(&[[-30.0, 20.0], [0.0, 20.0], [1e-5, 20.0 - step], [30.0, 20.0 - step]])
}

fn planned(part: Part, loads: Vec<LoadCase>, curved: Option<bool>) -> GripSet {
    let mut request = Request::new("", "robotiq-2f85");
    request.mass = Some(Mass(0.2));
    request.force = Some(Force(FORCE));
    request.candidates.spacing = Some(Length(0.005));
    request.candidates.curved = curved;
    request.candidates.angle_step = Angle(90_f64.to_radians());
    request.scoring.backend = Choice::Cpu;
    let plan = Plan::builder(request).part(part).loads(loads).build().unwrap();
    plan.run(&mut (), &AtomicBool::new(false)).unwrap().set
}

fn load(force: DVec3, moment: DVec3) -> LoadCase {
    LoadCase { name: "load".into(), wrench: Wrench { force, moment } }
}

fn pull() -> Vec<LoadCase> {
    vec![load(DVec3::new(3.0, 0.0, 4.0), DVec3::new(0.0, 0.1, 0.0))]
}

/// Grips that close along `y` over the middle of the depth, with the approach along `z`: `x` of the pads'
/// middle \[mm\], and the grip.
fn across(set: &GripSet) -> Vec<(f64, &RankedGrip)> {
    let along = |grip: &&RankedGrip| {
        let Frame { rotation, origin } = grip.grip.part_from_grip;
        origin.z.abs() < 1e-5 && rotation.z_axis.y.abs() > 0.999 && rotation.x_axis.z.abs() > 0.999
    };
    let place = |grip: &RankedGrip| grip.grip.part_from_grip.origin.x * 1e3;
    set.grips.iter().filter(along).map(|grip| (place(grip), grip)).collect()
}

/// Pressed areas on the upper and the lower side of the part [mm2].
fn areas(grip: &RankedGrip) -> [f64; 2] {
    let contact = &grip.grip.contact;
    let areas = [&contact.face_i, &contact.face_ii].map(|face| patch_area(face) * 1e6);
    if grip.grip.part_from_grip.rotation.z_axis.y > 0.0 { areas } else { [areas[1], areas[0]] }
}

#[test]
fn a_step_lower_than_the_pads_give_is_touched_too() {
    for step in [0.005, 0.02, 0.05, 0.15, 0.3, 1.0] {
        let set = planned(stepped(step), pull(), None);
        let found = across(&set);
        let (mut over_step, mut above) = (0, 0);
        for (x, grip) in found {
            // Pads of 20 mm along x, over the length of the part that they cover.
            let upper = (10.0 - x).clamp(0.0, 20.0_f64.min(x + 40.0)) * 20.0;
            let lower = (10.0 + x).clamp(0.0, 20.0_f64.min(40.0 - x)) * 20.0;
            let [top, bottom] = areas(grip);
            let both = upper + lower;
            // Compression under the force where the upper land carries all of it [mm].
            let alone = FORCE / (STIFFNESS * upper * 1e-6) * 1e3;
            let expected = match (upper > 0.0, alone > step) {
                (false, _) => lower,
                (true, true) => both,
                (true, false) => upper,
            };
            assert!((top - expected).abs() < 0.02, "{step} at {x}: {top} for {expected}");
            assert!((bottom - both).abs() < 0.02, "{step} at {x}: {bottom} for {both}");
            if upper > 1.0 && lower > 1.0 {
                over_step += 1;
                above += usize::from(x > 0.1);
                let layered = grip.grip.surfaces.is_some();
                assert!(layered || step > 0.25, "{step} at {x}");
            }
        }
        assert!(over_step > 2, "{step}: {over_step}");
        // Where most of the pad is over the lower land too.
        assert!(above > 0 || step > 0.25, "{step}: {above}");
    }
}

#[test]
fn a_step_that_vanishes_leaves_the_grip_of_the_plane() {
    let mu = |step: f64| -> Vec<(f64, f64)> {
        let set = planned(stepped(step), pull(), None);
        let mut found: Vec<(f64, f64)> =
            across(&set).iter().map(|(x, grip)| (*x, grip.worst.mu_s.unwrap())).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found
    };
    let flat = planned(bar(&[[-30.0, 20.0], [30.0, 20.0]]), pull(), None);
    let flat = across(&flat);
    // Micrometres, more than what counts as one plane.
    for (step, within) in [(4e-3, 0.2), (2e-3, 0.1)] {
        let mut compared = 0;
        for (x, mu) in mu(step) {
            for (at, grip) in &flat {
                if (x - at).abs() < 1e-3 {
                    let expected = grip.worst.mu_s.unwrap();
                    assert!((mu / expected - 1.0).abs() < within, "{step} at {x}: {mu} {expected}");
                    compared += 1;
                }
            }
        }
        assert!(compared > 3, "{step}: {compared}");
    }
}

#[test]
fn sharp_edges_chamfers_and_small_rounds_leave_a_plane_alone() {
    let chamfer = [[-30.0, 18.0], [-28.0, 20.0], [28.0, 20.0], [30.0, 18.0]];
    let round: Vec<[f64; 2]> = (0..=12)
        .map(|k| (f64::from(k) * 7.5).to_radians())
        .map(|angle| [29.0 + angle.sin(), 19.0 + angle.cos()])
        .map(|[x, y]| [x.min(29.9999999), y])
        .collect();
    let round: Vec<[f64; 2]> = [[-30.0, 20.0]].into_iter().chain(round).collect();
    for top in
        [&chamfer[..], &round[..12], &[[-30.0, 20.0], [0.0, 20.0], [1e-5, 17.0], [30.0, 17.0]]]
    {
        let (with, without) =
            (planned(bar(top), pull(), Some(true)), planned(bar(top), pull(), Some(false)));
        let plane = |set: &GripSet| -> Vec<(f64, f64)> {
            let found = across(set);
            let found = found.iter().filter(|(_, grip)| grip.grip.surfaces.is_none());
            let mut found: Vec<(f64, f64)> =
                found.map(|(x, grip)| (*x, grip.worst.mu_s.unwrap())).collect();
            found.sort_by(|a, b| a.partial_cmp(b).unwrap());
            found
        };
        let (with, without) = (plane(&with), plane(&without));
        assert!(with.len() > 5, "{}", with.len());
        assert_eq!(with, without);
    }
}

/// A gentle slope beside a land is pressed and pushes the part aside: what the land alone would hold
/// with next to no friction needs much of it.
#[test]
fn a_slope_beside_a_land_pushes() {
    let slope = 10_f64.to_radians().tan();
    let part = bar(&[[-30.0, 20.0], [-25.0, 20.0], [30.0, 20.0 - 55.0 * slope]]);
    let none = vec![load(DVec3::ZERO, DVec3::ZERO)];
    let set = planned(part, none, None);
    let found = across(&set);
    let pressed: Vec<_> = found.iter().filter(|(_, grip)| grip.grip.surfaces.is_some()).collect();
    assert!(!pressed.is_empty());
    let mut exact = 0;
    for (x, grip) in pressed {
        let covered = (x + 10.0).min(-25.0) - (x - 10.0).max(-30.0);
        let [top, _] = areas(grip);
        // Compression at the edge of the land from the equation of the force [mm].
        let [land, per] = [covered * 20.0, 20.0 / slope];
        let force = FORCE / STIFFNESS * 1e9;
        let delta = (-land + (land * land + 2.0 * per * force).sqrt()) / per;
        let strip = (delta / slope).min(x + 10.0 + 25.0);
        if strip < x + 35.0 && covered > 0.0 {
            exact += 1;
            assert!(
                (top / (land + 20.0 * strip) - 1.0).abs() < 1e-3,
                "{x}: {top} {}",
                land + 20.0 * strip
            );
            let mu = grip.worst.mu_s.unwrap();
            // The slope's share of the force pushes along x; both faces' friction takes it.
            let aside = 0.5 * delta * strip * 20.0 / force * slope;
            assert!(mu > 0.4 * aside, "{x}: {mu} {aside}");
        }
    }
    assert!(exact > 0);
}
