//! The order of the grips: score, ties, flips, rejections, duplicates, diverse choice.

use crate::support::grips;
use glam::{DMat3, DVec3};
use gripfast::model::{Frame, Status};
use gripfast::rank::{Options, Weights, rank};
use gripfast::results::{PadFriction, RankedGrip};
use proptest::prelude::*;

const SIZE: f64 = 0.075;

fn at(id: u64, origin: DVec3, mu_s: f64) -> RankedGrip {
    let mut grip = grips::grip(id, Frame { rotation: DMat3::IDENTITY, origin }, mu_s);
    grip.grip.width = 0.02;
    grip
}

fn ids(grips: &[RankedGrip]) -> Vec<u64> {
    grips.iter().map(|grip| grip.grip.id).collect()
}

#[test]
fn falling_score_and_the_count_of_what_was_left_out() {
    let mut list: Vec<_> = [0.3, 0.1, 0.2, 0.4, 0.5, 0.6, 0.7]
        .iter()
        .enumerate()
        .map(|(id, mu_s)| at(id as u64, DVec3::ZERO, *mu_s))
        .collect();
    list[3].worst.status = Status::TwistedOut;
    list[4].grip.flip_of = Some(0);
    list[5].worst.mu_s = None;
    list[6].worst.status = Status::Ambiguous;
    let found = rank(list, DVec3::ZERO, SIZE, &Options::default());
    assert_eq!(ids(&found.grips), [1, 2, 0, 6]);
    assert_eq!(found.grips.iter().map(|grip| grip.rank).collect::<Vec<_>>(), [1, 2, 3, 4]);
    assert_eq!(found.grips[0].score, Some(1.0 / 0.1 + 0.25));
    assert_eq!(found.ranked, 4);
    assert_eq!(
        found.rejections.into_iter().collect::<Vec<_>>(),
        [("flip".to_owned(), 1), ("not_finite".to_owned(), 1), ("twisted_out".to_owned(), 1)]
    );
}

#[test]
fn grips_that_slip_come_after_those_that_hold() {
    let pads = PadFriction { value: Some(0.25), safety: 1.0 };
    let options = Options::default().with_pads(pads);
    let mut list: Vec<_> = [0.3, 0.1, 0.2, 0.25, 0.5]
        .iter()
        .enumerate()
        .map(|(id, mu_s)| at(id as u64, DVec3::X * 0.01 * id as f64, *mu_s))
        .collect();
    // A large alpha makes up for friction in the score, not in the verdict.
    list[4].alpha = 30.0;
    let found = rank(list.clone(), DVec3::ZERO, SIZE, &options);
    assert_eq!(ids(&found.grips), [1, 2, 3, 4, 0]);
    assert_eq!((found.ranked, found.holding), (5, 3));
    let holds: Vec<_> = found.grips.iter().map(|grip| grip.holds).collect();
    assert_eq!(holds, [Some(true), Some(true), Some(true), Some(false), Some(false)]);
    // A choice of grips that differ takes one that slips last, however far it lies away.
    list[4].grip.part_from_grip.origin = DVec3::splat(1.0);
    let few = options.with_top(Some(3)).with_diverse(true);
    assert_eq!(ids(&rank(list.clone(), DVec3::ZERO, SIZE, &few).grips), [1, 2, 3]);
    // Half the friction with a safety of 2; nothing is known without one.
    let safe = options.with_pads(PadFriction { safety: 2.0, ..pads });
    assert_eq!(ids(&rank(list.clone(), DVec3::ZERO, SIZE, &safe).grips), [1, 4, 2, 3, 0]);
    let unknown = rank(list, DVec3::ZERO, SIZE, &Options::default());
    assert_eq!(ids(&unknown.grips), [4, 1, 2, 3, 0]);
    assert!(unknown.grips.iter().all(|grip| grip.holds.is_none()));
}

#[test]
fn no_friction_needed_is_best_and_weights_count() {
    let mut list =
        vec![at(0, DVec3::ZERO, 0.1), at(1, DVec3::ZERO, 0.0), at(2, DVec3::ZERO, 1e-300)];
    list[0].alpha = 1.5;
    let found = rank(list.clone(), DVec3::ZERO, SIZE, &Options::default());
    assert_eq!(ids(&found.grips), [1, 2, 0]);
    assert_eq!(found.grips[0].score, None, "infinite is null");
    // A grip that needs none ties with no other, whatever their numbers.
    assert_eq!(
        ids(&rank(
            vec![at(0, DVec3::ZERO, 0.1), at(1, DVec3::ZERO, 0.0)],
            DVec3::ZERO,
            SIZE,
            &Options::default()
        )
        .grips),
        [1, 0]
    );
    let weights = Weights { k1: 0.0, k2: 2.0 };
    let found = rank(list, DVec3::ZERO, SIZE, &Options::default().with_weights(weights));
    assert_eq!(ids(&found.grips), [0, 1, 2]);
    assert_eq!(found.grips[0].score, Some(3.0));
}

#[test]
fn scores_equal_up_to_rounding_follow_the_ids() {
    let list = vec![
        at(5, DVec3::ZERO, 0.2),
        at(3, DVec3::ZERO, 0.2 * (1.0 + 1e-12)),
        at(4, DVec3::ZERO, 0.2 * (1.0 - 1e-12)),
        at(1, DVec3::ZERO, 0.2001),
        at(9, DVec3::ZERO, 0.1999),
    ];
    assert_eq!(ids(&rank(list, DVec3::ZERO, SIZE, &Options::default()).grips), [9, 3, 4, 5, 1]);
}

#[test]
fn ties_go_to_the_centre_of_mass_then_to_symmetry_then_to_the_larger_contact() {
    let com = DVec3::new(0.01, 0.0, 0.0);
    let mut list = vec![
        at(0, com + DVec3::Y * 0.004, 0.2),
        at(1, com + DVec3::Y * 0.002, 0.2),
        at(2, com - DVec3::X * 0.002, 0.2),
        at(3, com + DVec3::Z * (0.002 + 1e-12), 0.2),
        at(4, com, 0.2001),
        at(5, com + DVec3::Y * 0.002, 0.2),
    ];
    for grip in &mut list {
        let contact = std::sync::Arc::make_mut(&mut grip.grip.contact);
        contact.face_i = contact.face_ii.clone();
    }
    // Those of 5 are larger.
    let contact = std::sync::Arc::make_mut(&mut list[5].grip.contact);
    for polygon in contact.face_i.iter_mut().chain(&mut contact.face_ii) {
        polygon.outer.iter_mut().for_each(|point| *point *= 1.1);
    }
    // The contacts of 1 lie beside the plane in which the jaws close.
    let contact = std::sync::Arc::make_mut(&mut list[1].grip.contact);
    for point in contact.face_i.iter_mut().flat_map(|polygon| &mut polygon.outer) {
        point.y += 1e-3;
    }
    let found = rank(list, com, SIZE, &Options::default());
    assert_eq!(ids(&found.grips), [5, 2, 3, 1, 0, 4]);
}

#[test]
fn duplicates_by_symmetry_are_merged_only_when_they_score_and_look_the_same() {
    let com = DVec3::new(0.001, 0.002, 0.003);
    let list = vec![
        at(0, com + DVec3::new(0.01, 0.005, 0.0), 0.2),
        at(1, com + DVec3::new(0.01, -0.005, 0.0), 0.2), // mirrored in x2
        at(2, com + DVec3::new(0.01, -0.005, 0.0), 0.2 + 1e-13), // the same within rounding
        at(3, com + DVec3::new(-0.01, 0.005, 0.0), 0.2), // elsewhere along the approach
        at(4, com + DVec3::new(0.01, 0.005, 0.0), 0.25), // scores otherwise
    ];
    let found = rank(list.clone(), com, SIZE, &Options::default().with_merge_duplicates(true));
    assert_eq!(ids(&found.grips), [0, 3, 4]);
    assert_eq!(found.grips[0].merged, [1, 2]);
    assert_eq!(found.rejections["duplicate"], 2);
    assert_eq!(rank(list, com, SIZE, &Options::default()).grips.len(), 5);
}

#[test]
fn a_diverse_choice_keeps_the_best_and_leaves_the_neighbourhood() {
    // 100 grips on a line, the best at one end, and one poor grip with another approach.
    let mut list: Vec<_> = (0..100_u64)
        .map(|id| at(id, DVec3::new(0.0005 * id as f64, 0.0, 0.0), 0.1 + 0.001 * id as f64))
        .collect();
    let mut turned = at(100, DVec3::ZERO, 0.9);
    turned.grip.part_from_grip.rotation = DMat3::from_rotation_z(std::f64::consts::PI);
    list.push(turned);
    let options = Options::default().with_top(Some(3)).with_diverse(true);
    let found = rank(list.clone(), DVec3::ZERO, SIZE, &options);
    assert_eq!(found.grips.len(), 3);
    assert_eq!(found.grips[0].grip.id, 0);
    assert_eq!(found.grips[2].grip.id, 100);
    assert!(found.grips[1].grip.id >= 50, "half the part away");
    assert_eq!(found.grips[2].rank, 101, "ranks are those of the whole list");
    assert_eq!(found.ranked, 101);
    assert_eq!(
        ids(&rank(list.clone(), DVec3::ZERO, SIZE, &Options::default().with_top(Some(3))).grips),
        [0, 1, 2]
    );
    // More than there are: all of them, in order.
    assert_eq!(rank(list, DVec3::ZERO, SIZE, &options.with_top(Some(500))).grips.len(), 101);
    assert_eq!(rank(vec![], DVec3::ZERO, SIZE, &options).grips.len(), 0);
}

proptest! {
    #[test]
    fn the_order_of_the_input_and_rounding_noise_do_not_matter(
        values in prop::collection::vec((0_u8..5, 0_u8..3, -1.0..1.0_f64), 1..60),
        noise in prop::collection::vec(-1e-12..1e-12_f64, 60),
        shuffle in prop::collection::vec(any::<u32>(), 60),
        diverse in any::<bool>(),
    ) {
        let make = |noisy: bool| -> Vec<RankedGrip> {
            values.iter().enumerate().map(|(id, (mu_s, place, x))| {
                let mu_s = 0.1 * f64::from(*mu_s) * if noisy { 1.0 + noise[id] } else { 1.0 };
                let x = if *place == 0 { *x } else { 0.01 * f64::from(*place) };
                at(id as u64, DVec3::new(x, 0.0, 0.0), mu_s)
            }).collect()
        };
        let mut shuffled = make(true);
        shuffled.sort_by_key(|grip| shuffle[grip.grip.id as usize]);
        let options = Options::default().with_merge_duplicates(true).with_top(Some(10)).with_diverse(diverse);
        let one = rank(make(false), DVec3::ZERO, SIZE, &options);
        let two = rank(shuffled, DVec3::ZERO, SIZE, &options);
        prop_assert_eq!(ids(&one.grips), ids(&two.grips));
        prop_assert_eq!(one.rejections, two.rejections);
        prop_assert!(one.grips.len() as u64 <= one.ranked);
    }
}
