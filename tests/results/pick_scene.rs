//! The run-time choice: planted scenes with known answers, random scenes against brute force,
//! threads, the command line.

use crate::support::grips;
use glam::{DMat3, DQuat, DVec3};
use gripfast::gripper::{Body, Gripper, Jaw, Shape};
use gripfast::model::Frame;
use gripfast::part::Mesh;
use gripfast::pick::{Obstacle, Phase, Picker, Reach, Reason, Reference, Retreat, Scene, Solid};
use gripfast::results::{GripSet, RankedGrip};
use parry3d_f64::math::Pose;
use parry3d_f64::query;
use parry3d_f64::shape::{Cuboid, TriMesh};
use proptest::prelude::*;

/// Approach down (-z in the world) at the origin, closing along y, `width` 20 mm.
fn down(id: u64, origin: DVec3) -> RankedGrip {
    let rotation = DMat3::from_cols(DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y);
    let mut grip = grips::grip(id, Frame { rotation, origin }, 0.2);
    grip.grip.width = 0.02;
    grip.rank = id + 1;
    grip
}

fn set(grips: Vec<RankedGrip>) -> GripSet {
    let mut set = grips::grip_set(0);
    set.grips = grips;
    set
}

fn boxed(name: &str, half: DVec3, origin: DVec3) -> Obstacle {
    Obstacle {
        name: name.into(),
        solid: Solid::Box { half },
        frame: Reference::World,
        world_from_obstacle: Frame { rotation: DMat3::IDENTITY, origin },
    }
}

fn box_mesh(half: DVec3) -> Mesh {
    let vertices = (0..8)
        .map(|corner: u8| {
            half * DVec3::new(sign(corner & 1), sign(corner >> 1 & 1), sign(corner >> 2))
        })
        .collect();
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        vertices,
        triangles: faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect(),
    }
}

fn sign(bit: u8) -> f64 {
    if bit == 0 { -1.0 } else { 1.0 }
}

fn meshed(name: &str, half: DVec3, world_from_obstacle: Frame) -> Obstacle {
    Obstacle {
        name: name.into(),
        solid: Solid::Mesh { mesh: box_mesh(half), closed: true },
        frame: Reference::World,
        world_from_obstacle,
    }
}

fn pick(set: &GripSet, scene: &Scene) -> (Option<usize>, Vec<Reason>) {
    let pick = Picker::new(set, scene).unwrap().pick(&scene.world_from_part);
    (pick.chosen, pick.passed)
}

/// The one reason for a single grip that is not free.
fn reason(scene: &Scene) -> Option<Reason> {
    let (chosen, passed) = pick(&set(vec![down(0, DVec3::ZERO)]), scene);
    assert_eq!(chosen.is_some(), passed.is_empty());
    passed.first().copied()
}

fn collision(obstacle: usize, phase: Phase, jaw: &'static str) -> Option<Reason> {
    Some(Reason::Collision { obstacle, phase, jaw, body: 0 })
}

// The gripper of tests/support: fingers reach from -40 to 10 mm along the approach, 8 mm to either
// side of x2 = 0, 8 mm thick behind the pad; the palm from -80 to -40 mm, 30 mm to either side, 60
// mm along x3. Here the approach is -z and the closing axis -y, so jaw I (x3 > 0) is at y < 0.

#[test]
fn an_empty_scene_takes_the_first_grip() {
    assert_eq!(
        pick(&set(vec![down(0, DVec3::ZERO), down(1, DVec3::X)]), &Scene::default()),
        (Some(0), vec![])
    );
    assert_eq!(pick(&set(vec![]), &Scene::default()), (None, vec![]));
}

#[test]
fn each_kind_of_obstacle_stops_the_body_that_meets_it() {
    for shape in ["box", "mesh"] {
        let scene = |half: DVec3, origin: DVec3| {
            let obstacle = if shape == "box" {
                boxed("o", half, origin)
            } else {
                meshed("o", half, Frame { rotation: DMat3::IDENTITY, origin })
            };
            Scene { obstacles: vec![obstacle], ..Scene::default() }
        };
        let small = DVec3::splat(0.002);
        // In the grip: beside the pad of jaw I (y from -10 to -18 mm), and where the opening
        // fingers get to (5 mm on).
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, -0.014, 0.0))),
            collision(0, Phase::Grip, "I"),
            "{shape}"
        );
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, 0.014, 0.0))),
            collision(0, Phase::Grip, "II"),
            "{shape}"
        );
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, -0.022, 0.0))),
            collision(0, Phase::Grip, "I"),
            "{shape}"
        );
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, -0.0252, 0.0))),
            None,
            "{shape}: 0.2 mm beyond the opening of 5 mm"
        );
        // Between the pads there is the part.
        assert_eq!(reason(&scene(small, DVec3::ZERO)), None, "{shape}");
        // The palm, and the way down to it.
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, 0.05, 0.06))),
            collision(0, Phase::Grip, ""),
            "{shape}"
        );
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, 0.05, 0.15))),
            collision(0, Phase::Approach, ""),
            "{shape}"
        );
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, 0.05, 0.1821))),
            None,
            "{shape}: above the approach of 100 mm"
        );
        assert_eq!(
            reason(&scene(small, DVec3::new(0.0, 0.05, 0.0379))),
            None,
            "{shape}: below the palm"
        );
        // Wholly inside: no surface is met.
        assert_eq!(
            reason(&scene(DVec3::splat(2.0), DVec3::ZERO)),
            collision(0, Phase::Grip, "I"),
            "{shape}"
        );
    }
}

#[test]
fn clearance_is_kept_all_round() {
    let at = |z: f64, clearance: f64| {
        reason(&Scene {
            obstacles: vec![boxed("o", DVec3::new(0.1, 0.1, 0.01), DVec3::new(0.0, 0.0, z))],
            clearance,
            ..Scene::default()
        })
    };
    // Fingertips end at z = -10 mm.
    assert_eq!(at(-0.0201, 0.0), None);
    assert_eq!(at(-0.0201, 0.0005), collision(0, Phase::Grip, "I"));
    assert_eq!(at(-0.0199, 0.0), collision(0, Phase::Grip, "I"));
}

#[test]
fn a_table_is_a_half_space() {
    let table = |height: f64, tilt: f64| Scene {
        obstacles: vec![Obstacle {
            name: "table".into(),
            solid: Solid::HalfSpace,
            frame: Reference::World,
            world_from_obstacle: Frame {
                rotation: DMat3::from_rotation_x(tilt),
                origin: DVec3::new(0.3, 0.0, height),
            },
        }],
        ..Scene::default()
    };
    assert_eq!(reason(&table(-0.0101, 0.0)), None);
    assert_eq!(reason(&table(-0.0099, 0.0)), collision(0, Phase::Grip, "I"));
    // Tilted so that it rises towards +y: jaw II, there, is the first to touch.
    assert_eq!(reason(&table(-0.0145, 0.2)), collision(0, Phase::Grip, "II"));
}

#[test]
fn the_retreat_is_tested_with_closed_jaws() {
    let bar = boxed("bar", DVec3::new(0.002, 0.002, 0.002), DVec3::new(0.04, 0.0, 0.0));
    let scene = Scene { obstacles: vec![bar], ..Scene::default() };
    assert_eq!(reason(&scene), None);
    let sideways = Scene { retreat: Retreat::Along(DVec3::new(0.05, 0.0, 0.0)), ..scene.clone() };
    assert_eq!(reason(&sideways), None, "the bar passes between the jaws");
    let lower = Scene {
        obstacles: vec![boxed("bar", DVec3::new(0.002, 0.05, 0.002), DVec3::new(0.04, 0.0, 0.0))],
        ..sideways.clone()
    };
    assert_eq!(reason(&lower), collision(0, Phase::Retreat, "I"));
    let up = Scene {
        retreat: Retreat::Along(DVec3::new(0.0, 0.0, 0.2)),
        obstacles: vec![boxed("lid", DVec3::new(0.1, 0.1, 0.001), DVec3::new(0.0, 0.0, 0.25))],
        ..scene
    };
    assert_eq!(reason(&up), collision(0, Phase::Retreat, ""));
    assert_eq!(reason(&Scene { retreat: Retreat::Back(0.1), ..up.clone() }), None);
    assert_eq!(
        reason(&Scene { retreat: Retreat::Back(0.2), ..up }),
        collision(0, Phase::Retreat, "")
    );
}

#[test]
fn cone_reach_and_stroke() {
    let half = 0.5;
    let tilted = DVec3::new(0.5_f64.tan(), 0.0, -1.0).normalize();
    assert_eq!(reason(&Scene { cone: Some((tilted, half + 1e-6)), ..Scene::default() }), None);
    assert!(
        matches!(reason(&Scene { cone: Some((tilted, half - 1e-6)), ..Scene::default() }), Some(Reason::Cone(angle)) if (angle - half).abs() < 1e-9)
    );
    // The flange is 100 mm behind the pads: at z = +100 mm.
    let reach = |least, most| Scene {
        reach: Some(Reach { base: DVec3::new(0.0, 0.0, -0.4), least, most }),
        ..Scene::default()
    };
    assert_eq!(reason(&reach(0.4999, 0.5001)), None);
    assert!(
        matches!(reason(&reach(0.5001, 0.9)), Some(Reason::Reach(distance)) if (distance - 0.5).abs() < 1e-12)
    );
    assert!(matches!(reason(&reach(0.1, 0.4999)), Some(Reason::Reach(_))));
    let mut wide = down(0, DVec3::ZERO);
    wide.grip.width = 0.0851;
    assert!(
        matches!(pick(&set(vec![wide.clone()]), &Scene::default()).1[..], [Reason::Stroke(gap)] if gap == 0.0851)
    );
    wide.grip.width = 0.085;
    assert_eq!(pick(&set(vec![wide]), &Scene::default()).0, Some(0));
}

#[test]
fn the_part_pose_moves_the_grips_and_reasons_are_in_order() {
    let list = set((0..5).map(|id| down(id, DVec3::new(0.2 * id as f64, 0.0, 0.0))).collect());
    let scene = Scene {
        obstacles: vec![
            boxed("left", DVec3::splat(0.03), DVec3::new(0.0, 0.0, 0.0)),
            boxed("right", DVec3::splat(0.03), DVec3::new(0.2, 0.0, 0.0)),
        ],
        ..Scene::default()
    };
    let picker = Picker::new(&list, &scene).unwrap();
    let found = picker.pick(&Frame::IDENTITY);
    assert_eq!(found.chosen, Some(2));
    assert!(
        picker.describe(&found.passed[0]).contains("meets 'left' in the grip"),
        "{}",
        picker.describe(&found.passed[0])
    );
    assert!(picker.describe(&found.passed[1]).contains("finger of jaw I meets 'right'"));
    let moved =
        picker.pick(&Frame { rotation: DMat3::IDENTITY, origin: DVec3::new(-0.4, 0.0, 0.0) });
    assert_eq!(moved.chosen, Some(0));
}

#[test]
fn inside_grips_draw_their_jaws_together() {
    let mut list = set(vec![down(0, DVec3::ZERO)]);
    list.gripper["outer_pad"] = serde_json::json!(0.008);
    list.grips[0].grip.inside = true;
    list.grips[0].grip.width = 0.05;
    // The pads are 34 mm apart, 24 mm before the jaws spread; nothing moves outside of the slot's
    // walls at 25 mm.
    let wall = |y: f64| Scene {
        obstacles: vec![boxed("wall", DVec3::new(0.1, 0.001, 0.02), DVec3::new(0.0, y, 0.0))],
        ..Scene::default()
    };
    assert_eq!(pick(&list, &wall(0.0261)).0, Some(0));
    assert_eq!(pick(&list, &wall(0.0259)).1, vec![collision(0, Phase::Grip, "II").unwrap()]);
    assert_eq!(pick(&list, &wall(0.0131)).1, vec![collision(0, Phase::Grip, "II").unwrap()]);
    assert_eq!(pick(&list, &wall(0.0109)).0, Some(0));
}

fn frame() -> impl Strategy<Value = Frame> {
    (prop::array::uniform3(-3.0..3.0_f64), prop::array::uniform3(-0.15..0.15_f64)).prop_map(
        |(turn, origin)| Frame {
            rotation: DMat3::from_quat(DQuat::from_scaled_axis(DVec3::from_array(turn))),
            origin: DVec3::from_array(origin),
        },
    )
}

/// Places of each body along its way, sampled: phase, jaw, index, pose in the grip frame, half
/// sizes.
fn places(
    gripper: &Gripper,
    width: f64,
    scene: &Scene,
) -> Vec<(Phase, &'static str, usize, Frame, DVec3)> {
    const STEPS: u32 = 24;
    let mut found = Vec::new();
    let half = |body: &Body| match body.shape {
        Shape::Box { half } => half,
        _ => unreachable!("the gripper of these tests is made of boxes"),
    };
    let shifted =
        |frame: &Frame, way: DVec3| Frame { rotation: frame.rotation, origin: frame.origin + way };
    for step in 0..=STEPS {
        let share = f64::from(step) / f64::from(STEPS);
        let opening = 0.005;
        for (phase, extra, way) in [
            (Phase::Grip, opening * share, 0.0),
            (Phase::Approach, opening, scene.approach * share),
            (Phase::Retreat, 0.0, scene.approach * share),
        ] {
            for jaw in Jaw::BOTH {
                for (index, body) in gripper.finger(jaw, width + 2.0 * extra).iter().enumerate() {
                    found.push((
                        phase,
                        jaw.name(),
                        index,
                        shifted(&body.grip_from_body, DVec3::NEG_X * way),
                        half(body),
                    ));
                }
            }
            for (index, body) in gripper.palm.iter().enumerate() {
                found.push((
                    phase,
                    "",
                    index,
                    shifted(&body.grip_from_body, DVec3::NEG_X * way),
                    half(body),
                ));
            }
        }
    }
    found
}

fn parry(frame: &Frame) -> Pose {
    Pose::from_parts(frame.origin, DQuat::from_mat3(&frame.rotation))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn random_scenes_agree_with_brute_force(
        obstacles in prop::collection::vec((frame(), prop::array::uniform3(0.002..0.06_f64), any::<bool>()), 1..4),
        poses in prop::collection::vec(frame(), 8),
    ) {
        let scene = Scene {
            obstacles: obstacles.iter().enumerate().map(|(index, (frame, half, mesh))| {
                let half = DVec3::from_array(*half);
                let solid = if *mesh { Solid::Mesh { mesh: box_mesh(half), closed: true } } else { Solid::Box { half } };
                Obstacle { name: format!("o{index}"), solid, frame: Reference::World, world_from_obstacle: *frame }
            }).collect(),
            ..Scene::default()
        };
        let gripper = grips::gripper();
        let solids: Vec<(Pose, Cuboid)> = obstacles.iter().map(|(frame, half, _)| (parry(frame), Cuboid::new(DVec3::from_array(*half)))).collect();
        for pose in poses {
            let mut grip = grips::grip(0, pose, 0.1);
            grip.grip.width = 0.03;
            let list = set(vec![grip]);
            let (chosen, passed) = pick(&list, &scene);
            let places = places(&gripper, 0.03, &scene);
            let distance = |place: &(Phase, &'static str, usize, Frame, DVec3), obstacle: usize| {
                query::distance(&parry(&pose.compose(&place.3)), &Cuboid::new(place.4), &solids[obstacle].0, &solids[obstacle].1).unwrap().distance
            };
            match passed.first() {
                // No false accept: no sampled place of any body meets anything.
                None => {
                    prop_assert!(chosen == Some(0));
                    for place in &places {
                        for obstacle in 0..solids.len() {
                            let met = query::intersection_test(&parry(&pose.compose(&place.3)), &Cuboid::new(place.4 - 1e-9), &solids[obstacle].0, &solids[obstacle].1).unwrap().intersecting;
                            prop_assert!(!met, "{:?} {} meets obstacle {obstacle}", place.0, place.1);
                        }
                    }
                }
                // No false alarm: the body named comes within a step of the obstacle named, in that
                // phase.
                Some(Reason::Collision { obstacle, phase, jaw, body }) => {
                    let near = places.iter().filter(|place| (place.0, place.1, place.2) == (*phase, *jaw, *body)).map(|place| distance(place, *obstacle)).fold(f64::INFINITY, f64::min);
                    prop_assert!(near <= 0.1 / 24.0 / 2.0 + 1e-9, "{phase:?} {jaw}: {near}");
                }
                Some(other) => prop_assert!(false, "{other:?}"),
            }
        }
    }
}

/// Everything that a body of the test gripper passes through on its ways, as the corners of a box:
/// phase, jaw, index.
fn swept(
    gripper: &Gripper,
    width: f64,
    scene: &Scene,
) -> Vec<(Phase, &'static str, usize, [DVec3; 2])> {
    let mut found: Vec<(Phase, &'static str, usize, [DVec3; 2])> = Vec::new();
    // Boxes that move along their own axes: the union of all places is the box around them.
    for (phase, jaw, body, frame, half) in places(gripper, width, scene) {
        let half = (frame.rotation * half).abs();
        let (low, high) = (frame.origin - half, frame.origin + half);
        match found.iter_mut().find(|known| (known.0, known.1, known.2) == (phase, jaw, body)) {
            Some((.., bounds)) => *bounds = [bounds[0].min(low), bounds[1].max(high)],
            None => found.push((phase, jaw, body, [low, high])),
        }
    }
    found
}

/// By how much a box and a triangle are apart at least, or how deep they overlap (negative), over
/// the 13 axes that can separate them.
fn apart([low, high]: [DVec3; 2], triangle: [DVec3; 3]) -> f64 {
    let [a, b, c] = triangle;
    let edges = [b - a, c - b, a - c];
    let axes = DVec3::AXES
        .into_iter()
        .chain([edges[0].cross(edges[1])])
        .chain(edges.into_iter().flat_map(|edge| DVec3::AXES.map(|axis| edge.cross(axis))));
    axes.filter_map(DVec3::try_normalize)
        .map(|axis| {
            let corners = (0..8).map(|corner: u8| {
                axis.dot(DVec3::select(
                    glam::BVec3::new(corner & 1 > 0, corner & 2 > 0, corner & 4 > 0),
                    high,
                    low,
                ))
            });
            let (least, most) = corners
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), x| {
                    (least.min(x), most.max(x))
                });
            let along = triangle.map(|corner| axis.dot(corner));
            let (first, last) =
                (along[0].min(along[1]).min(along[2]), along[0].max(along[1]).max(along[2]));
            (first - most).max(least - last)
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// A random number of this seed and index in `0..1`.
fn share(seed: u64, index: u64) -> f64 {
    let mut state = seed
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(index.wrapping_mul(0xbf58_476d_1ce4_e5b9));
    for _ in 0..3 {
        state = (state ^ (state >> 30)).wrapping_mul(0x94d0_49bb_1331_11eb);
    }
    (state >> 11) as f64 / (1_u64 << 53) as f64
}

fn somewhere(seed: u64, index: u64, around: f64) -> Frame {
    let number = |k: u64| 2.0 * share(seed, 6 * index + k) - 1.0;
    let turn = DQuat::from_scaled_axis(DVec3::new(number(0), number(1), number(2)) * 3.0);
    Frame {
        rotation: DMat3::from_quat(turn),
        origin: DVec3::new(number(3), number(4), number(5)) * around,
    }
}

/// Separate triangles of all sizes from 1 to 200 mm.
fn loose(seed: u64, count: u64) -> Mesh {
    let vertices = (0..count)
        .flat_map(|index| {
            let frame = somewhere(seed, index, 0.3);
            let size = 0.001 * 200_f64.powf(share(seed + 1, index).powi(3));
            [DVec3::ZERO, DVec3::X, DVec3::new(0.3, 0.6, 0.0)]
                .map(|corner| frame.point(corner * size))
        })
        .collect();
    Mesh {
        vertices,
        triangles: (0..count as u32)
            .map(|index| [3 * index, 3 * index + 1, 3 * index + 2])
            .collect(),
    }
}

#[test]
fn verdicts_on_random_meshes_agree_with_all_triangles_and_with_single_checks() {
    let gripper = grips::gripper();
    let (mut free_ones, mut blocked_ones) = (0, 0);
    for seed in 0..12_u64 {
        // Scenes of one mesh or three, near the world's origin and 20 m away, where single
        // precision is 2 um.
        let away = if seed % 4 == 3 { DVec3::new(20.0, -13.0, 7.0) } else { DVec3::ZERO };
        let meshes = match seed % 3 {
            0 => vec![terrain(40)],
            1 => vec![loose(seed, 30 + 20 * seed)],
            _ => vec![terrain(12), loose(seed, 60), box_mesh(DVec3::new(0.02, 0.05, 0.1))],
        };
        let placed = |index: usize| {
            let frame = somewhere(seed + 50, index as u64, 0.05);
            Frame { origin: frame.origin + away, ..frame }
        };
        let obstacles = meshes.iter().enumerate().map(|(index, mesh)| Obstacle {
            name: format!("o{index}"),
            solid: Solid::Mesh { mesh: mesh.clone(), closed: false },
            frame: Reference::World,
            world_from_obstacle: placed(index),
        });
        let scene = Scene { obstacles: obstacles.collect(), ..Scene::default() };
        let world_from_part =
            Frame { rotation: DMat3::from_rotation_z(0.1 * seed as f64), origin: away };
        let mut list = set((0..120)
            .map(|id| {
                let mut grip = grips::grip(id, somewhere(seed + 100, id, 0.3), 0.1);
                grip.grip.width = 0.02 + 0.005 * (id % 5) as f64;
                grip
            })
            .collect());
        // An obstacle's triangles in the grip frame, and how far a body is from them all.
        let seen = |grip: &RankedGrip, obstacle: usize| -> Vec<[DVec3; 3]> {
            let world_from_grip = world_from_part.compose(&grip.grip.part_from_grip);
            let corner =
                |corner: DVec3| world_from_grip.point_inverse(placed(obstacle).point(corner));
            (0..meshes[obstacle].triangles.len() as u32)
                .map(|index| meshes[obstacle].corners(index).map(corner))
                .collect()
        };
        let distance = |triangles: &[[DVec3; 3]], bounds: [DVec3; 2]| {
            triangles.iter().fold(f64::INFINITY, |least: f64, &triangle| {
                // The distance along the box's own axes is a part of what `apart` looks at, and
                // cheap.
                let (low, high) = (
                    triangle[0].min(triangle[1]).min(triangle[2]),
                    triangle[0].max(triangle[1]).max(triangle[2]),
                );
                if (low - bounds[1]).max(bounds[0] - high).max_element() >= least {
                    least
                } else {
                    least.min(apart(bounds, triangle))
                }
            })
        };
        let nearest = |grip: &RankedGrip| {
            let triangles: Vec<_> =
                (0..meshes.len()).flat_map(|obstacle| seen(grip, obstacle)).collect();
            swept(&gripper, grip.grip.width, &scene)
                .iter()
                .map(|body| distance(&triangles, body.3))
                .fold(f64::INFINITY, f64::min)
        };
        // Rounding of poses 20 m away is 4e-15 m; what touches within 1e-12 m may go either way.
        let gaps: Vec<f64> = list.grips.iter().map(nearest).collect();
        assert!(gaps.iter().all(|gap| gap.abs() > 1e-12), "seed {seed}: a grip touches");
        let is_true = |grip: &RankedGrip, reason: &Reason| match *reason {
            Reason::Collision { obstacle, phase, jaw, body } => {
                let swept = swept(&gripper, grip.grip.width, &scene);
                let named = swept
                    .iter()
                    .find(|known| (known.0, known.1, known.2) == (phase, jaw, body))
                    .unwrap();
                distance(&seen(grip, obstacle), named.3) < 1e-12
            }
            _ => false,
        };
        let picker = Picker::new(&list, &scene).unwrap();
        for (index, gap) in gaps.iter().enumerate() {
            let reason = picker.check(index, &world_from_part);
            assert_eq!(
                reason.is_none(),
                *gap > 0.0,
                "seed {seed}, grip {index}: {reason:?}, {gap} m apart"
            );
            assert!(
                reason.iter().all(|reason| is_true(&list.grips[index], reason)),
                "seed {seed}, grip {index}: {reason:?}"
            );
        }
        // One after the other, what earlier grips met being remembered: each free one is found, and
        // none before it.
        let mut gaps = gaps;
        while !list.grips.is_empty() {
            let found = Picker::new(&list, &scene).unwrap().pick(&world_from_part);
            assert_eq!(found.chosen, gaps.iter().position(|gap| *gap > 0.0), "seed {seed}");
            assert!(
                found.passed.iter().zip(&list.grips).all(|(reason, grip)| is_true(grip, reason)),
                "seed {seed}"
            );
            blocked_ones += found.passed.len();
            free_ones += usize::from(found.chosen.is_some());
            let done = found.passed.len() + usize::from(found.chosen.is_some());
            list.grips.drain(..done);
            gaps.drain(..done);
        }
    }
    assert!(
        free_ones > 200 && blocked_ones > 200,
        "{free_ones} free, {blocked_ones} not: scenes that test both"
    );
}

/// A bumpy sheet of 2 n^2 triangles with walls, 0.6 m wide.
fn terrain(n: usize) -> Mesh {
    let height = |i: usize, j: usize| {
        let (x, y) = (i as f64 / n as f64 - 0.5, j as f64 / n as f64 - 0.5);
        0.03 * (31.0 * x).sin() * (27.0 * y).cos() + 0.4 * (x.abs().max(y.abs()) - 0.4).max(0.0)
    };
    let vertices = (0..=n)
        .flat_map(|i| {
            (0..=n).map(move |j| {
                DVec3::new(
                    0.6 * (i as f64 / n as f64 - 0.5),
                    0.6 * (j as f64 / n as f64 - 0.5),
                    height(i, j),
                )
            })
        })
        .collect();
    let at = |i: usize, j: usize| u32::try_from(i * (n + 1) + j).unwrap();
    let triangles = (0..n)
        .flat_map(|i| {
            (0..n).flat_map(move |j| {
                [
                    [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                    [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                ]
            })
        })
        .collect();
    Mesh { vertices, triangles }
}

fn many(count: u64) -> GripSet {
    set((0..count)
        .map(|id| {
            let share = id as f64 / count as f64;
            let mut grip = down(
                id,
                DVec3::new(
                    0.2 * (share * 40.0).cos(),
                    0.2 * (share * 57.0).sin(),
                    0.05 * (share * 700.0).sin(),
                ),
            );
            grip.grip.part_from_grip.rotation = DMat3::from_quat(
                DQuat::from_rotation_z(share * 300.0)
                    * DQuat::from_rotation_x(0.3 * (share * 91.0).sin()),
            ) * grip.grip.part_from_grip.rotation;
            grip
        })
        .collect())
}

#[test]
fn a_large_mesh_agrees_with_brute_force_and_with_any_number_of_threads() {
    let mesh = terrain(60);
    let scene = Scene {
        obstacles: vec![Obstacle {
            name: "bin".into(),
            solid: Solid::Mesh { mesh: mesh.clone(), closed: false },
            frame: Reference::World,
            world_from_obstacle: Frame::IDENTITY,
        }],
        ..Scene::default()
    };
    let list = many(300);
    let gripper = grips::gripper();
    let surface = TriMesh::new(mesh.vertices, mesh.triangles).unwrap();
    // Each grip by itself, so that every one gets an answer.
    let (mut free, mut met) = (0, 0);
    for ranked in &list.grips {
        let passed = pick(&set(vec![ranked.clone()]), &scene).1;
        let places = places(&gripper, 0.02, &scene);
        let hit = |place: &(Phase, &'static str, usize, Frame, DVec3)| {
            query::intersection_test(
                &parry(&ranked.grip.part_from_grip.compose(&place.3)),
                &Cuboid::new(place.4 - 1e-9),
                &Pose::IDENTITY,
                &surface,
            )
            .unwrap()
            .intersecting
        };
        match passed.first() {
            None => {
                free += 1;
                assert!(!places.iter().any(hit), "grip {} is not free", ranked.grip.id);
            }
            Some(Reason::Collision { phase, jaw, body, .. }) => {
                met += 1;
                let near = places
                    .iter()
                    .filter(|place| (place.0, place.1, place.2) == (*phase, *jaw, *body))
                    .map(|place| {
                        query::distance(
                            &parry(&ranked.grip.part_from_grip.compose(&place.3)),
                            &Cuboid::new(place.4),
                            &Pose::IDENTITY,
                            &surface,
                        )
                        .unwrap()
                        .distance
                    });
                assert!(
                    near.fold(f64::INFINITY, f64::min) <= 0.1 / 24.0 / 2.0 + 1e-9,
                    "grip {}",
                    ranked.grip.id
                );
            }
            Some(other) => panic!("{other:?}"),
        }
    }
    assert!(free > 30 && met > 30, "{free} free, {met} not: a scene that tests both");
    // Every grip but the last few blocked: reasons are the same for one thread and for many.
    let blocked = Scene {
        obstacles: vec![Obstacle {
            world_from_obstacle: Frame {
                rotation: DMat3::IDENTITY,
                origin: DVec3::new(0.0, 0.0, 0.04),
            },
            ..scene.obstacles[0].clone()
        }],
        ..Scene::default()
    };
    let list = many(5000);
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap()
        .install(|| pick(&list, &blocked));
    let many = rayon::ThreadPoolBuilder::new()
        .num_threads(7)
        .build()
        .unwrap()
        .install(|| pick(&list, &blocked));
    assert_eq!(one, many);
}

#[test]
fn a_robot_stands_at_the_origin_unless_its_base_is_given() {
    let read = |text: &str| {
        let reach = "[robot]\nreach = [\"100mm\", \"200mm\"]\n";
        let scene = Scene::parse("scene", &format!("{reach}{text}"), std::path::Path::new(""));
        scene.unwrap().reach.unwrap().base
    };
    assert_eq!(read(""), DVec3::ZERO);
    assert_eq!(read("base = [\"0mm\", \"5mm\", \"0mm\"]"), DVec3::new(0.0, 5e-3, 0.0));
}
