//! The earlier evaluation function beside the score: both for the same grips, and how far their
//! orders agree.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::lab::earlier;
use crate::rank::ties;
use crate::request::EarlierWeights;
use crate::results::{Comparison, EarlierScore, RankedGrip};

/// Grips named in [`Comparison::risen`] and [`Comparison::fallen`], at most.
const NAMED: usize = 5;

/// Fills in [`RankedGrip::earlier`] of an ordered list and compares the two orders.
/// `centre_of_mass` \[m\] is the part's, in the part frame; `force` is the gripping force \[N\]. Grips
/// without an area on both faces, which no ranking holds, are left out.
pub fn compare(
    grips: &mut [RankedGrip],
    centre_of_mass: DVec3,
    force: f64,
    weights: &EarlierWeights,
) -> Comparison {
    grips
        .par_iter_mut()
        .for_each(|ranked| ranked.earlier = earlier(ranked, centre_of_mass, force, weights));
    let listed: Vec<usize> =
        (0..grips.len()).filter(|&index| grips[index].earlier.is_some()).collect();
    let evaluations: Vec<f64> = grips
        .iter()
        .filter_map(|ranked| ranked.earlier.as_ref())
        .map(|earlier| earlier.evaluation)
        .collect();
    let before = places(&evaluations);
    let now = places(
        &listed
            .iter()
            .map(|&index| grips[index].score.unwrap_or(f64::INFINITY))
            .collect::<Vec<_>>(),
    );
    for (&index, &place) in listed.iter().zip(&before) {
        if let Some(earlier) = &mut grips[index].earlier {
            earlier.place = place;
        }
    }
    // Of grips that tie in both orders, as those that a symmetry maps to each other do, the first
    // stands for all.
    let mut moved: Vec<(f64, f64, u64)> = listed
        .iter()
        .enumerate()
        .map(|(at, &index)| (before[at] - now[at], now[at], grips[index].grip.id))
        .collect();
    let mut most = |sense: f64| -> Vec<u64> {
        moved.sort_by(|a, b| {
            (sense * b.0).total_cmp(&(sense * a.0)).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2))
        });
        let first = moved.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(|tied| tied[0]);
        first.take_while(|moved| sense * moved.0 > 0.0).take(NAMED).map(|moved| moved.2).collect()
    };
    let (risen, fallen) = (most(1.0), most(-1.0));
    Comparison {
        grips: listed.len() as u64,
        k1: weights.k1,
        k2: weights.k2,
        k3: weights.k3,
        epsilon_m: weights.epsilon,
        spearman: spearman(&now, &before),
        kendall_tau_b: kendall(&now, &before),
        risen,
        fallen,
    }
}

/// Places of the grips of a list by score, as [`EarlierScore::place`] counts them.
pub fn places_by_score(grips: &[RankedGrip]) -> Vec<f64> {
    places(&grips.iter().map(|ranked| ranked.score.unwrap_or(f64::INFINITY)).collect::<Vec<_>>())
}

fn earlier(
    ranked: &RankedGrip,
    centre_of_mass: DVec3,
    force: f64,
    weights: &EarlierWeights,
) -> Option<EarlierScore> {
    let grip = &ranked.grip;
    // The method knows plane contacts only.
    if grip.surfaces.is_some() {
        return None;
    }
    let centre = grip.part_from_grip.point_inverse(centre_of_mass).truncate();
    let evaluation = earlier::evaluation(&grip.contact, grip.width, centre, weights)
        .filter(|value| value.is_finite())?;
    let centroid = earlier::centroid(&grip.contact)?;
    let slip_centre: DVec2 = centroid.slip_centre;
    let mu_s = centroid.mu_s(force, &ranked.worst.wrench);
    Some(EarlierScore {
        evaluation,
        place: 0.0,
        mu_s,
        slip_centre: slip_centre.to_array(),
        distance: slip_centre.distance(centre),
    })
}

/// The place of each value, the largest first, from 1; values that tie as in [`crate::rank`] share
/// the mean of their places.
fn places(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
    let mut places = vec![0.0; values.len()];
    let mut next = 1;
    for run in order.chunk_by(|&a, &b| ties(values[a], values[b])) {
        for &index in run {
            places[index] = next as f64 + (run.len() - 1) as f64 / 2.0;
        }
        next += run.len();
    }
    places
}

/// Spearman's rank correlation: Pearson's of the places. `None` where one side has no two different
/// places.
fn spearman(a: &[f64], b: &[f64]) -> Option<f64> {
    let middle = (a.len() as f64 + 1.0) / 2.0;
    let sum = |f: &dyn Fn(f64, f64) -> f64| {
        a.iter().zip(b).map(|(&x, &y)| f(x - middle, y - middle)).sum::<f64>()
    };
    let (xx, yy, xy) = (sum(&|x, _| x * x), sum(&|_, y| y * y), sum(&|x, y| x * y));
    (xx > 0.0 && yy > 0.0).then(|| (xy / (xx * yy).sqrt()).clamp(-1.0, 1.0))
}

/// Kendall's tau-b, which allows for ties, in `n log n` (Knight 1966: discordant pairs are the
/// exchanges of a merge sort). `None` where one side has no two different places.
fn kendall(a: &[f64], b: &[f64]) -> Option<f64> {
    let pairs = |n: usize| n as f64 * (n as f64 - 1.0) / 2.0;
    let tied = |lengths: &mut dyn Iterator<Item = usize>| lengths.map(pairs).sum::<f64>();
    let mut order: Vec<(f64, f64)> = a.iter().copied().zip(b.iter().copied()).collect();
    order.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.total_cmp(&y.1)));
    let (all, tied_a) =
        (pairs(order.len()), tied(&mut order.chunk_by(|x, y| x.0 == y.0).map(<[_]>::len)));
    let tied_both = tied(&mut order.chunk_by(|x, y| x == y).map(<[_]>::len));
    let mut second: Vec<f64> = order.into_iter().map(|(_, y)| y).collect();
    let exchanges = sort_counting(&mut second) as f64;
    let tied_b = tied(&mut second.chunk_by(|x, y| x == y).map(<[_]>::len));
    let (untied_a, untied_b) = (all - tied_a, all - tied_b);
    let difference = all - tied_a - tied_b + tied_both - 2.0 * exchanges;
    (untied_a > 0.0 && untied_b > 0.0)
        .then(|| (difference / (untied_a * untied_b).sqrt()).clamp(-1.0, 1.0))
}

/// Sorts and counts the pairs that stood in falling order.
fn sort_counting(values: &mut [f64]) -> u64 {
    if values.len() < 2 {
        return 0;
    }
    let (left, right) = values.split_at_mut(values.len() / 2);
    let mut count = sort_counting(left) + sort_counting(right);
    let mut merged = Vec::with_capacity(left.len() + right.len());
    let (mut i, mut j) = (0, 0);
    while i < left.len() || j < right.len() {
        if j == right.len() || (i < left.len() && left[i] <= right[j]) {
            merged.push(left[i]);
            i += 1;
        } else {
            merged.push(right[j]);
            j += 1;
            count += (left.len() - i) as u64;
        }
    }
    values.copy_from_slice(&merged);
    count
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn places_share_the_mean_of_a_tie() {
        let third = 1.0 / 3.0;
        assert_eq!(
            places(&[2.0, 5.0, 2.0, f64::INFINITY, f64::INFINITY]),
            [4.5, 3.0, 4.5, 1.5, 1.5]
        );
        assert_eq!(places(&[third, third * (1.0 + 1e-12), 0.2]), [1.5, 1.5, 3.0]);
        assert!(places(&[]).is_empty());
    }

    #[test]
    fn correlations_of_known_orders() {
        // Kendall's own example of 1955, and its reverse.
        let (a, b) = ([1.0, 2.0, 3.0, 4.0, 5.0], [3.0, 4.0, 1.0, 2.0, 5.0]);
        assert!((spearman(&a, &b).unwrap() - 0.2).abs() < 1e-15);
        assert!((kendall(&a, &b).unwrap() - 0.2).abs() < 1e-15);
        assert_eq!((spearman(&a, &a), kendall(&a, &a)), (Some(1.0), Some(1.0)));
        let back: Vec<f64> = a.iter().rev().copied().collect();
        assert_eq!((spearman(&a, &back), kendall(&a, &back)), (Some(-1.0), Some(-1.0)));
        for flat in [&[2.0, 2.0, 2.0][..], &[1.0], &[]] {
            assert_eq!((spearman(flat, flat), kendall(flat, flat)), (None, None));
        }
    }

    proptest! {
        #[test]
        fn kendall_counts_pairs_as_the_definition_does(pairs in prop::collection::vec((0u8..12, 0u8..12), 2..60)) {
            let (a, b): (Vec<f64>, Vec<f64>) = pairs.iter().map(|&(x, y)| (f64::from(x), f64::from(y))).unzip();
            let (mut sum, mut untied) = (0.0, [0.0; 2]);
            for i in 0..a.len() {
                for j in 0..i {
                    let (x, y) = ((a[i] - a[j]).signum() * f64::from(a[i] != a[j]), (b[i] - b[j]).signum() * f64::from(b[i] != b[j]));
                    sum += x * y;
                    untied[0] += x * x;
                    untied[1] += y * y;
                }
            }
            let expected = (untied[0] > 0.0 && untied[1] > 0.0).then(|| sum / (untied[0] * untied[1]).sqrt());
            match (kendall(&a, &b), expected) {
                (Some(got), Some(expected)) => prop_assert!((got - expected).abs() < 1e-12, "{got} {expected}"),
                (got, expected) => prop_assert_eq!(got, expected),
            }
        }
    }
}
