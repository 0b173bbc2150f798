//! Which places are tried: low parts on a table, limits that are options, contacts over several
//! faces, angles of real edges.

use glam::DVec3;
use gripfast::geometry::patch_area;
use gripfast::gripper::{self, Gripper, Jaw, catalogue};
use gripfast::model::Grip;
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{Cone, Ground, ProposeOptions, Proposer, Tally};

use crate::support::reference;

fn block(size: DVec3) -> Part {
    let vertices: Vec<DVec3> = (0..8)
        .map(|corner| {
            let bit = |shift: u32| f64::from(corner >> shift & 1);
            size * DVec3::new(bit(0) - 0.5, bit(1) - 0.5, bit(2))
        })
        .collect();
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> =
        faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Part::from_triangles("block", &vertices, &triangles).unwrap()
}

fn run(part: &Part, gripper: &Gripper, options: &ProposeOptions) -> (Vec<Grip>, Tally) {
    let mut proposer = Proposer::new(part, gripper, options).unwrap();
    let grips = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    (grips, proposer.tally().clone())
}

fn trial(path: &str) -> Option<Part> {
    reference(&format!("trials/{path}"))
        .map(|path| Part::read(&path, &ReadOptions::default()).unwrap())
}

/// From above, on the table z = 0.
fn on_a_table() -> ProposeOptions {
    ProposeOptions::default()
        .with_approach_cone(Some(Cone { axis: DVec3::NEG_Z, half_angle: 2_f64.to_radians() }))
        .with_ground(Some(Ground { normal: DVec3::Z, offset: 0.0 }))
}

/// How far the lowest body of a finger stands below the pads' middle in an approach from above.
fn lowest(gripper: &Gripper) -> f64 {
    gripper.fingers.iter().map(|body| body.bounds()[1].x).fold(0.0, f64::max)
}

#[test]
fn plates_on_a_table_are_gripped_from_above_at_any_spacing() {
    for (name, _) in catalogue::CATALOGUE {
        let gripper = gripper::find(name).unwrap();
        let width = 0.8 * gripper.stroke[1];
        let pad = gripper.pad.iter().map(|point| point.x).fold(0.0, f64::max);
        for height in [3.0, 5.0, 7.5, 10.0, 12.0, 15.0, 20.0, 30.0] {
            let height = height * 1e-3;
            let plate = block(DVec3::new(width, 0.06, height));
            // Of the pads stands above the table what the fingertips below them leave.
            let covered = (height - (lowest(&gripper) - pad)).min(2.0 * pad);
            for spacing in [None, Some(0.009), Some(0.037)] {
                let options = on_a_table().with_spacing(spacing);
                let (grips, tally) = run(&plate, &gripper, &options);
                let place = format!("{name}, {height} m, {spacing:?}: {tally:?}");
                if covered < 0.25 * height.min(2.0 * pad) {
                    continue;
                }
                assert!(!grips.is_empty(), "{place}");
                let most = grips
                    .iter()
                    .filter(|grip| (grip.width - width).abs() < 1e-9)
                    .map(|grip| patch_area(&grip.contact.face_i))
                    .fold(0.0, f64::max);
                let across: f64 = 2.0 * gripper.pad.iter().map(|p| p.y).fold(0.0, f64::max);
                // Flush with the table a finger may lie a few micrometres in it; where pads run along
                // arcs, closing fingers are given as much room as these leave their chord.
                let bulge = gripper.travel.bulge(width, (width + 0.01).min(gripper.stroke[1]));
                let more = most / across - covered;
                assert!((-2e-6 - bulge..5e-6).contains(&more), "{place}: {more} {bulge}");
                for grip in &grips {
                    for body in gripper
                        .finger(Jaw::I, grip.width)
                        .iter()
                        .chain(&gripper.finger(Jaw::II, grip.width))
                    {
                        let down = grip.part_from_grip.rotation.transpose() * DVec3::NEG_Z;
                        let low = grip.part_from_grip.point(body.support_point(down)).z;
                        assert!(low > -1e-5, "{place}: {low}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_leaning_plate_is_gripped_just_above_the_table() {
    // Sides that lean by 20 degrees: pads go down along them until the lower fingertip meets the
    // table, with the jaws open.
    let lean = 20_f64.to_radians();
    let upright = block(DVec3::new(0.04, 0.06, 0.05));
    let vertices: Vec<DVec3> =
        upright.mesh.vertices.iter().map(|v| *v + DVec3::X * (v.z * lean.tan())).collect();
    let plate = Part::from_triangles("plate", &vertices, &upright.mesh.triangles).unwrap();
    let gripper = gripper::find("generic").unwrap();
    let options = ProposeOptions::default()
        .with_approach_cone(Some(Cone { axis: DVec3::NEG_Z, half_angle: lean + 0.01 }))
        .with_ground(Some(Ground { normal: DVec3::Z, offset: 0.0 }))
        .with_spacing(Some(0.037));
    let (grips, tally) = run(&plate, &gripper, &options);
    let lowest = grips
        .iter()
        .filter(|grip| grip.part_from_grip.rotation.z_axis.x.abs() > 0.9)
        .map(|grip| {
            let open = grip.width + 2.0 * options.opening;
            let bodies = [Jaw::I, Jaw::II].map(|jaw| gripper.finger(jaw, open)).concat();
            let down = grip.part_from_grip.rotation.transpose() * DVec3::NEG_Z;
            bodies
                .iter()
                .map(|body| grip.part_from_grip.point(body.support_point(down)).z)
                .fold(f64::INFINITY, f64::min)
        })
        .fold(f64::INFINITY, f64::min);
    assert!((-1e-5..1e-5).contains(&lowest), "{lowest} {tally:?}");
}

#[test]
fn the_plates_of_the_trials_are_gripped() {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    for name in ["slab5", "slab10", "slab20"] {
        let Some(part) = trial(&format!("tables/{name}.stl")) else { return };
        let (grips, tally) = run(&part, &gripper, &on_a_table());
        assert!(grips.len() > 20, "{name}: {tally:?}");
    }
}

#[test]
fn the_numbers_of_the_grid_come_first_and_special_places_follow() {
    let gripper = gripper::find("generic").unwrap();
    let part = block(DVec3::new(0.06, 0.04, 0.03));
    let proposer = Proposer::new(&part, &gripper, &ProposeOptions::default()).unwrap();
    let grid: usize =
        proposer.sites().iter().map(|site| site.positions.len() * site.angles.len()).sum();
    let (grips, tally) = run(&part, &gripper, &ProposeOptions::default());
    let special = grips.iter().filter(|grip| grip.id >= grid as u64).count();
    assert!(special > 20 && special < grips.len() / 2, "{special} of {}", grips.len());
    assert!(grips.iter().all(|grip| grip.id < tally.candidates));
    let mut ids: Vec<u64> = grips.iter().map(|grip| grip.id).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), grips.len());
    // A pad flush with both edges of a corner, as no grid of this spacing has it.
    let half = 0.01;
    let corner = |grip: &&Grip| {
        let at = grip.part_from_grip.origin.abs();
        (at.x - (0.03 - half)).abs() < 1e-9 && (at.z - half).abs() < 1e-9
    };
    let odd = ProposeOptions::default().with_spacing(Some(0.0077));
    assert!(run(&part, &gripper, &odd).0.iter().any(|grip| corner(&grip)));
}

#[test]
fn limits_are_options_and_are_counted_by_themselves() {
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let width = |width: f64| block(DVec3::new(width * 1e-3, 0.1, 0.1));
    let with = |part: &Part, min_opening: f64| {
        run(part, &gripper, &ProposeOptions::default().with_min_opening(min_opening))
    };
    let standard = ProposeOptions::default();
    assert!(!run(&width(84.8), &gripper, &standard).0.is_empty());
    let (grips, tally) = run(&width(85.1), &gripper, &standard);
    assert!(grips.is_empty() && tally.rejections["face_pair_outside_stroke"] == 3);
    assert_eq!(tally.widths_outside.len(), 2);
    let remarks = tally.remarks(&gripper, &standard);
    assert!(remarks[0].contains("85.10, 100.00 mm") && remarks[0].contains("85.00"), "{remarks:?}");
    let (grips, tally) = with(&width(84.8), 0.25e-3);
    assert!(grips.is_empty() && tally.rejections["face_pair_opening_too_small"] == 1);
    assert!(!with(&width(85.0), 0.0).0.is_empty(), "touching the end of the stroke is allowed");
    // M3 nuts: flats of 2 % of the pad and less.
    let Some(nut) = trial("nuts/m3nut.stl") else { return };
    let flats = |options: &ProposeOptions| {
        let (grips, tally) = run(&nut, &gripper, options);
        (grips.iter().filter(|grip| (grip.width - 0.0055).abs() < 1e-5).count(), tally)
    };
    let (found, tally) = flats(&standard);
    assert!(found == 0 && tally.rejections["pad_share_too_small"] > 0, "{tally:?}");
    let all = ProposeOptions::default().with_min_pad_share(0.0);
    assert!(tally.remarks(&gripper, &standard).iter().any(|remark| remark.contains("2.00 %")));
    assert!(flats(&all).0 > 0, "{:?}", flats(&all).1);
}

#[test]
fn the_nearest_approach_to_an_empty_cone_is_named() {
    let part = block(DVec3::new(0.06, 0.04, 0.03));
    let axis = DVec3::new(1.0, 0.01, -1.0);
    let options = ProposeOptions::default()
        .with_approach_cone(Some(Cone { axis, half_angle: 0.1_f64.to_radians() }))
        .with_angle_step(90_f64.to_radians());
    let gripper = gripper::find("generic").unwrap();
    let (grips, tally) = run(&part, &gripper, &options);
    let nearest = tally.nearest_approach.unwrap();
    assert!(grips.is_empty() && (nearest - axis.angle_between(DVec3::X)).abs() < 1e-9);
    let remark = tally.remarks(&gripper, &options).concat();
    assert!(remark.contains("0.1 deg") && remark.contains("45.00 deg"), "{remark}");
}

#[test]
fn a_pad_over_two_lands_touches_both() {
    let Some(part) = trial("faces/lands_groove.stl") else { return };
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let options =
        ProposeOptions::default().with_spacing(Some(0.005)).with_angle_step(90_f64.to_radians());
    let (grips, _) = run(&part, &gripper, &options);
    // The lands reach from x = 0 to 10 and from 12 to 22 mm on the plane y = 10 mm.
    let place = DVec3::new(0.015, 0.005, 0.015);
    let there: Vec<&Grip> = grips
        .iter()
        .filter(|grip| grip.part_from_grip.origin.distance(place) < 1e-9 && grip.width < 0.0101)
        .collect();
    assert!(!there.is_empty());
    for grip in there {
        let lands = if part.faces[grip.face_i as usize].normal.y > 0.5 {
            &grip.contact.face_i
        } else {
            &grip.contact.face_ii
        };
        let pads = gripfast::geometry::Bounds2::of(
            &gripper
                .pad
                .iter()
                .map(|&p| grip.part_from_grip.rotation * p.extend(0.0))
                .map(|p| p.truncate().with_y(p.z))
                .collect::<Vec<_>>(),
        );
        // What the pad covers of both lands, seen along y.
        let span = |low: f64, high: f64, a: f64, b: f64| (high.min(b) - low.max(a)).max(0.0);
        let (x0, x1) = (place.x + pads.min.x, place.x + pads.max.x);
        let tall = span(place.z + pads.min.y, place.z + pads.max.y, 0.0, 0.02);
        let covered = tall * (span(x0, x1, 0.0, 0.01) + span(x0, x1, 0.012, 0.022));
        assert!((patch_area(lands) - covered).abs() < 1e-9, "{} {covered}", patch_area(lands));
        assert!(lands.len() == 2);
    }
}

#[test]
fn a_pad_beside_a_land_that_may_not_be_touched_touches_the_other_only() {
    let Some(part) = trial("faces/lands_groove.stl") else { return };
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let middle = |id: u32| {
        let outline = &part.faces[id as usize].polygons[0].outer;
        let points =
            outline.iter().map(|p| part.faces[id as usize].part_from_face.point(p.extend(0.0)));
        points.sum::<DVec3>() / outline.len() as f64
    };
    let lands: Vec<u32> =
        part.faces.iter().filter(|face| face.normal.y > 0.5).map(|face| face.id).collect();
    let (one, other): (Vec<u32>, Vec<u32>) =
        lands.iter().partition(|&&id| middle(id).y > 0.009 && middle(id).x < 0.01);
    let under = part.faces.iter().filter(|face| face.normal.y < -0.5).map(|face| face.id);
    assert!(one.len() == 1 && !other.is_empty());
    let options = ProposeOptions::default()
        .with_spacing(Some(0.005))
        .with_angle_step(90_f64.to_radians())
        .with_faces(Some(one.iter().copied().chain(under).collect()));
    let (grips, _) = run(&part, &gripper, &options);
    assert!(!grips.is_empty());
    let area = part.faces[one[0] as usize].area;
    for grip in &grips {
        let on_land =
            if grip.face_i == one[0] { &grip.contact.face_i } else { &grip.contact.face_ii };
        assert!(on_land.len() == 1 && patch_area(on_land) < area * (1.0 + 1e-9), "{grip:?}");
    }
}

#[test]
fn the_flat_between_two_bends_is_gripped() {
    for (name, offset) in [("bent_20", 0.02), ("bent_26", 0.02)] {
        let Some(part) = trial(&format!("faces/{name}.stl")) else { return };
        assert_eq!(part.faces.len(), 10, "{name}");
        let flat = |face: &&gripfast::part::PlanarFace| face.normal.y.abs() > 0.999;
        assert_eq!(part.faces.iter().filter(flat).count(), 2, "{name}");
        assert!(part.pairs(0.0, offset).iter().any(|pair| (pair.width - 0.003).abs() < 1e-6));
    }
}

#[test]
fn two_tessellations_of_a_part_give_the_same_angles() {
    let files = ["trials/tessellation/panel_cascadio.glb", "parts/parts/o2ac__02-PANEL.stl"];
    let gripper = gripper::find("robotiq-2f85").unwrap();
    let mut found = Vec::new();
    for file in files {
        let Some(path) = reference(file) else { return };
        let part = Part::read(&path, &ReadOptions::default()).unwrap();
        let options = ProposeOptions::default().with_angle_step(90_f64.to_radians());
        let proposer = Proposer::new(&part, &gripper, &options).unwrap();
        let sites = proposer.sites();
        let plane = |id: &u32| (*id as usize) < part.faces.len();
        let mut angles: Vec<(i64, Vec<i64>)> = sites
            .iter()
            .filter(|site| site.faces_i.iter().chain(&site.faces_ii).all(plane))
            .map(|site| {
                let steps = |value: f64, step: f64| (value / step).round() as i64;
                let mut angles: Vec<i64> =
                    site.angles.iter().map(|angle| steps(*angle, 2e-3)).collect();
                angles.sort_unstable();
                (steps(site.width, 1e-4), angles)
            })
            .collect();
        angles.sort();
        found.push(angles);
    }
    assert!(!found[0].is_empty());
    assert_eq!(found[0], found[1]);
}

/// With the jaws exchanged the areas are those of the flip, and the areas are told by its faces.
#[test]
fn a_pose_with_exchanged_jaws_is_explained_as_the_flip_is_listed() {
    // A step on one side only: the contacts differ.
    let ring = [(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (15.0, 20.0), (15.0, 12.0), (0.0, 12.0)];
    let corner = |(x, y): (f64, f64), z: f64| DVec3::new(x, y, z) * 1e-3;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for k in 0..6 {
        let (a, b) = (ring[k], ring[(k + 1) % 6]);
        let base = vertices.len() as u32;
        vertices.extend([corner(a, 0.0), corner(b, 0.0), corner(b, 25.0), corner(a, 25.0)]);
        triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    for (z, up) in [(0.0, false), (25.0, true)] {
        for [a, b, c] in [[0, 1, 4], [0, 4, 5], [1, 2, 4], [2, 3, 4]] {
            let base = vertices.len() as u32;
            vertices.extend([a, b, c].map(|k: usize| corner(ring[k], z)));
            triangles.push(if up {
                [base, base + 1, base + 2]
            } else {
                [base, base + 2, base + 1]
            });
        }
    }
    let part = Part::from_triangles("step", &vertices, &triangles).unwrap();
    assert!(part.health.watertight, "{:?}", part.health.lines());
    let gripper = gripfast::gripper::find("robotiq-2f85").unwrap();
    let options = ProposeOptions::default().with_flips(true).with_min_contact(0.05);
    let mut proposer = Proposer::new(&part, &gripper, &options).unwrap();
    let grips: Vec<_> = proposer.by_ref().flat_map(|chunk| chunk.grips).collect();
    let mut unequal = 0;
    for grip in grips.iter().step_by(7) {
        let told = proposer.explain_pose(grip.face_i, grip.face_ii, &grip.part_from_grip).unwrap();
        assert_eq!((told.face_i, told.face_ii), (grip.face_i, grip.face_ii));
        let measures = |contact: &gripfast::model::Contact| {
            [&contact.face_i, &contact.face_ii].map(|patch| {
                let moments = gripfast::geometry::patch_moments(patch);
                [moments.area * 1e3, moments.centroid.x, moments.centroid.y]
            })
        };
        let (told_i, listed) = (measures(&told.contact), measures(&grip.contact));
        for (a, b) in told_i.iter().flatten().zip(listed.iter().flatten()) {
            assert!((a - b).abs() < 1e-9, "{told_i:?} {listed:?}");
        }
        for (check, [area, ..]) in
            told.checks.iter().filter(|check| check.name.starts_with("contact")).zip(listed)
        {
            assert!(check.detail.starts_with(&format!("{:.2} mm^2", area * 1e3)), "{check:?}");
        }
        let flipped = grip.flip_of.is_some();
        unequal += usize::from(flipped && (listed[0][0] - listed[1][0]).abs() > 1e-6);
    }
    assert!(unequal > 5, "{unequal}");
}
