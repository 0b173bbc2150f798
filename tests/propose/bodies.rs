//! Gripper bodies in every form that the gripper file knows: the same solid as box, hull and mesh
//! gives the same grips.

use std::collections::BTreeSet;
use std::path::Path;

use glam::DVec3;
use gripfast::gripper::{self, Gripper, Shape};
use gripfast::part::{Part, ReadOptions};
use gripfast::propose::{ProposeOptions, Proposer};

/// An ASCII STL of boxes given by their corners [mm].
fn stl(boxes: &[[DVec3; 2]]) -> String {
    let mut text = String::from("solid finger\n");
    for [low, high] in boxes {
        let corner = |i: usize| {
            DVec3::new([low.x, high.x][i & 1], [low.y, high.y][i >> 1 & 1], [low.z, high.z][i >> 2])
        };
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            for triangle in [[a, b, c], [a, c, d]] {
                text += "facet normal 0 0 0\nouter loop\n";
                for index in triangle {
                    let point = corner(index);
                    text += &format!("vertex {} {} {}\n", point.x, point.y, point.z);
                }
                text += "endloop\nendfacet\n";
            }
        }
    }
    text + "endsolid finger\n"
}

/// The generic gripper with its fingers replaced by `fingers` (TOML).
fn gripper(folder: &Path, fingers: &str) -> gripfast::error::Result<Gripper> {
    let text = format!(
        "name = \"test\"\nstroke = [\"0mm\", \"100mm\"]\nforce = [\"10N\", \"150N\"]\n[pad]\nrectangle = [\"20mm\", \"20mm\"]\n{fingers}\n\
         [[palm]]\nname = \"housing\"\nbox = [\"80mm\", \"60mm\", \"160mm\"]\nat = [\"-92mm\", \"0mm\", \"0mm\"]\n"
    );
    let path = folder.join("gripper.toml");
    std::fs::write(&path, text).unwrap();
    gripper::file::read(&path)
}

fn grips(part: &Part, gripper: &Gripper) -> BTreeSet<u64> {
    let options = ProposeOptions::default()
        .with_spacing(Some(4e-3))
        .with_angle_step(0.6)
        .with_edge_angles(false);
    let proposer = Proposer::new(part, gripper, &options).unwrap();
    // Special places follow from the exact outline of the bodies.
    let grid: usize =
        proposer.sites().iter().map(|site| site.positions.len() * site.angles.len()).sum();
    let ids = proposer.flat_map(|chunk| chunk.grips).map(|grip| grip.id);
    ids.filter(|id| *id < grid as u64).collect()
}

#[test]
fn box_hull_and_mesh_agree() {
    let folder = tempfile::tempdir().unwrap();
    let part = Part::read(
        &crate::support::root().join("data/parts/l_bracket.stl"),
        &ReadOptions::default(),
    )
    .unwrap();
    let (tip, rest) = (
        [DVec3::new(-12.0, -11.0, 0.0), DVec3::new(12.0, 11.0, 10.0)],
        [DVec3::new(-52.0, -11.0, 2.0), DVec3::new(-12.0, 11.0, 18.0)],
    );
    let boxes = gripper(
        folder.path(),
        "[[finger]]\nname = \"tip\"\nbox = [\"24mm\", \"22mm\", \"10mm\"]\nat = [\"0mm\", \"0mm\", \"5mm\"]\n\
         [[finger]]\nname = \"rest\"\nbox = [\"40mm\", \"22mm\", \"16mm\"]\nat = [\"-32mm\", \"0mm\", \"10mm\"]\n",
    );
    let expected = grips(&part, &boxes.unwrap());
    assert!(expected.len() > 100, "{}", expected.len());

    let hull = |[low, high]: [DVec3; 2]| -> String {
        let point = |i: usize| {
            format!(
                "[\"{}mm\", \"{}mm\", \"{}mm\"]",
                [low.x, high.x][i & 1],
                [low.y, high.y][i >> 1 & 1],
                [low.z, high.z][i >> 2]
            )
        };
        (0..8).map(point).collect::<Vec<_>>().join(", ")
    };
    let hulls = format!(
        "[[finger]]\nname = \"tip\"\nhull = [{}]\n[[finger]]\nname = \"rest\"\nhull = [{}]\n",
        hull(tip),
        hull(rest)
    );
    // Two pieces in one file, in centimetres; moved by `at`.
    let up = |corners: [DVec3; 2]| corners.map(|corner| (corner + DVec3::Z) / 10.0);
    std::fs::write(folder.path().join("finger.stl"), stl(&[up(tip), up(rest)])).unwrap();
    let mesh = "[[finger]]\nname = \"all\"\nmesh = { file = \"finger.stl\", unit = \"cm\" }\nat = [\"0mm\", \"0mm\", \"-1mm\"]\n";
    for (form, fingers) in [("hull", hulls.as_str()), ("mesh", mesh)] {
        let made = gripper(folder.path(), fingers).unwrap();
        assert!(
            made.fingers.len() == 2
                && made.fingers.iter().all(|body| matches!(body.shape, Shape::Hull { .. })),
            "{form}: {:?}",
            made.fingers
        );
        let found = grips(&part, &made);
        // Where a body is exactly flush with the part, a box counts as free and another shape need
        // not.
        assert!(
            found.is_subset(&expected) && found.len() * 20 >= expected.len() * 19,
            "{form}: {} of {}",
            found.len(),
            expected.len()
        );
    }
}

#[test]
fn a_bent_finger_keeps_its_bay_free() {
    let folder = tempfile::tempdir().unwrap();
    // A finger that reaches far back outside and turns in at its end: a convex hull of it would
    // fill what lies between.
    let (arm, hook) = (
        [DVec3::new(-60.0, -5.0, 20.0), DVec3::new(6.0, 5.0, 28.0)],
        [DVec3::new(-6.0, -5.0, 0.0), DVec3::new(6.0, 5.0, 20.0)],
    );
    std::fs::write(folder.path().join("finger.stl"), stl(&[arm, hook])).unwrap();
    let made =
        gripper(folder.path(), "[[finger]]\nname = \"hook\"\nmesh = { file = \"finger.stl\" }\n")
            .unwrap();
    let bay = DVec3::new(-0.03, 0.0, 0.01);
    assert!(made.fingers.iter().all(|body| {
        let [low, high] = body.bounds();
        !(bay.cmpge(low).all() && bay.cmple(high).all())
    }));
}

#[test]
fn a_mesh_that_cannot_be_used_is_refused_with_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |mesh: &str| {
        gripper(folder.path(), &format!("[[finger]]\nname = \"tip\"\nmesh = {mesh}\n"))
            .unwrap_err()
            .to_string()
    };
    assert!(refused("{ file = \"absent.stl\" }").contains("absent.stl"));
    std::fs::write(folder.path().join("text.stl"), "no mesh").unwrap();
    assert!(refused("{ file = \"text.stl\" }").contains("text.stl"));
    std::fs::write(folder.path().join("box.stl"), stl(&[[DVec3::ZERO, DVec3::ONE]])).unwrap();
    let message = refused("{ file = \"box.stl\", unit = \"feet\" }");
    assert!(message.contains("finger.tip") && message.contains("mm, cm"), "{message}");
    let message = gripper::parse(
        "name = \"t\"\nstroke = [\"0mm\", \"9mm\"]\nforce = [\"1N\", \"9N\"]\n[pad]\nrectangle = [\"2mm\", \"2mm\"]\n[[finger]]\nname = \"tip\"\nmesh = { file = \"box.stl\" }\n",
        "text",
    );
    assert!(message.unwrap_err().to_string().contains("save it to a file"));
}

#[test]
fn palm_and_closing_fingers_follow_the_pads() {
    let folder = tempfile::tempdir().unwrap();
    // A block 60 mm wide, 100 mm high, gripped from above; the palm ends 12 mm behind the middle of
    // the touching pads, and pads 60 mm apart stand 6 mm nearer to it.
    let size = [DVec3::new(-30.0, -50.0, 0.0), DVec3::new(30.0, 50.0, 100.0)];
    std::fs::write(folder.path().join("block.stl"), stl(&[size])).unwrap();
    let part = Part::read(&folder.path().join("block.stl"), &ReadOptions::default()).unwrap();
    let lowest = |motion: &str| {
        let text = format!(
            "name = \"test\"\nstroke = [\"0mm\", \"80mm\"]\nforce = [\"10N\", \"150N\"]\n[pad]\nrectangle = [\"20mm\", \"20mm\"]\n\
             [[finger]]\nname = \"tip\"\nbox = [\"20mm\", \"20mm\", \"5mm\"]\nat = [\"0mm\", \"0mm\", \"2.5mm\"]\n\
             [[palm]]\nname = \"housing\"\nbox = [\"40mm\", \"60mm\", \"40mm\"]\nat = [\"-32mm\", \"0mm\", \"0mm\"]\n{motion}"
        );
        let gripper = gripper::parse(&text, "test").unwrap();
        let options = ProposeOptions::default().with_spacing(Some(1e-3));
        let grips = Proposer::new(&part, &gripper, &options).unwrap().flat_map(|c| c.grips);
        grips
            .filter(|grip| {
                (grip.width - 0.06).abs() < 1e-9 && grip.part_from_grip.rotation.x_axis.z < -0.999
            })
            .map(|grip| grip.part_from_grip.origin.z)
            .fold(f64::INFINITY, f64::min)
    };
    let parallel = lowest("");
    assert!((parallel - 0.088).abs() < 1.1e-3, "{parallel}");
    let table = "[motion]\ntable = [[\"0mm\", \"0mm\"], [\"80mm\", \"-8mm\"]]\n";
    assert!((lowest(table) - 0.094).abs() < 1.1e-3, "{}", lowest(table));
    // A crank of 57 mm from -5.4 degrees: 5.3 mm at 60 mm.
    let arc = "[motion]\narc = { crank = \"57.12mm\", angle = \"-5.43deg\" }\n";
    assert!((lowest(arc) - 0.0933).abs() < 1.1e-3, "{}", lowest(arc));
}

#[test]
fn motions_that_make_no_sense_are_refused() {
    let text = gripper::catalogue::text("generic").unwrap();
    for (motion, word) in [
        ("", "exactly one"),
        ("arc = { crank = \"20mm\", angle = \"0deg\" }", "longer crank"),
        ("table = [[\"0mm\", \"0mm\"]]", "cover the stroke"),
        ("table = [[\"0mm\", \"0mm\"], [\"1mm\", \"0mm\"]]", "cover the stroke"),
        ("table = [[\"0mm\"], [\"200mm\", \"0mm\"]]", "row of 1"),
        ("table = [[\"0mm\", \"0mm\", \"1rad\"], [\"200mm\", \"0mm\"]]", "cover the stroke"),
    ] {
        let error = gripper::parse(&format!("{text}\n[motion]\n{motion}\n"), "g").unwrap_err();
        assert!(error.to_string().contains(word), "{motion}: {error}");
    }
}
