//! Candidates that are rejected, sampled over all of them.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::proposer::{Item, Proposer};
use super::site::Places;
use super::work;
use crate::gripper::Jaws;
use crate::model::{Miss, Negative};
use crate::part::PairKind;

/// Candidates tried for each one asked for. A reason that is rarer among the candidates than one in
/// this many times the number asked for may be missed.
const TRIES: u64 = 64;
/// Candidates tried at least.
const LEAST_TRIES: u64 = 8192;

/// The places of one site at one angle.
struct Stretch {
    site: usize,
    places: Places,
    angle: usize,
    /// Number of its first pose: ids count them in this order.
    first: u64,
}

impl Proposer<'_> {
    /// Candidates that are rejected, `most` for each reason at most, from a fixed pseudo-random
    /// choice among all candidates. It depends on the input and the options only; the stream of
    /// chunks is neither used nor changed.
    pub fn rejected(&self, most: usize) -> Vec<Negative> {
        self.sampled(most, None).into_iter().map(|miss| miss.pose).collect()
    }

    /// As [`Proposer::rejected`]; with `measured`, which says how many closing directions may be
    /// looked at, also what each candidate lacks.
    pub(super) fn sampled(&self, most: usize, measured: Option<usize>) -> Vec<Miss> {
        let (stretches, total) = self.stretches();
        let tries = (TRIES * most as u64).max(LEAST_TRIES).min(total);
        let stretch_of =
            |pose: u64| &stretches[stretches.partition_point(|stretch| stretch.first <= pose) - 1];
        let mut poses: Vec<(u64, &Stretch)> =
            shuffled(total).take(tries as usize).map(|pose| (pose, stretch_of(pose))).collect();
        let direction = |stretch: &Stretch| self.sites[stretch.site].direction;
        if let Some(count) = measured {
            let kept = commonest(poses.iter().map(|(_, stretch)| direction(stretch)), count);
            poses.retain(|(_, stretch)| kept.contains(&direction(stretch)));
        }
        // One tree at a time, and what a site shares once.
        poses.sort_by_key(|(pose, stretch)| (direction(stretch), stretch.site, *pose));
        let mut rejected: Vec<Miss> = Vec::new();
        for group in poses.chunk_by(|a, b| direction(a.1) == direction(b.1)) {
            let tree = self.new_tree(direction(group[0].1));
            for group in group.chunk_by(|a, b| a.1.site == b.1.site) {
                let prepared = self.prepare(&self.sites[group[0].1.site]);
                let tried = group.par_iter().map_init(work::Buffers::default, |buffers, place| {
                    let (pose, stretch) = *place;
                    let position = (pose - stretch.first) as usize;
                    let item = Item {
                        site: stretch.site,
                        places: stretch.places,
                        angle: stretch.angle,
                        positions: position..position + 1,
                        id: pose * self.stride(),
                    };
                    let reasons = self.orientations().iter().filter_map(|&jaws| {
                        let mut outcome = work::Outcome::default();
                        self.survivors(&item, &prepared, &tree, jaws, buffers, &mut outcome);
                        let (reason, _) = outcome.rejections.pop()?;
                        let pose = self.negative(&item, jaws, reason.name());
                        Some((Miss::new(pose, None, None), item.clone(), jaws, reason))
                    });
                    reasons.collect::<Vec<_>>()
                });
                let mut tried: Vec<_> = tried.flatten_iter().collect();
                keep(&mut tried, most, |(miss, ..)| &miss.pose);
                if measured.is_some() {
                    tried.par_iter_mut().for_each(|(miss, item, jaws, reason)| {
                        (miss.by, miss.place) = self.lack(item, &prepared, &tree, *jaws, reason);
                    });
                }
                rejected.extend(tried.into_iter().map(|(miss, ..)| miss));
            }
        }
        keep(&mut rejected, most, |miss| &miss.pose);
        rejected
    }

    /// All places in the order of their numbers, and how many there are.
    fn stretches(&self) -> (Vec<Stretch>, u64) {
        let (mut stretches, mut first) = (Vec::new(), 0);
        for sites in [0..self.plane, self.plane..self.sites.len()] {
            for places in [Places::Grid, Places::Special] {
                for site in sites.clone() {
                    for angle in 0..self.sites[site].angles.len() {
                        stretches.push(Stretch { site, places, angle, first });
                        first += self.sites[site].places(places, angle).len() as u64;
                    }
                }
            }
        }
        (stretches, first)
    }

    /// The candidate of an item with one position.
    fn negative(&self, item: &Item, jaws: Jaws, reason: String) -> Negative {
        let site = &self.sites[item.site];
        let angle = site.angles[item.angle];
        let place = site.places(item.places, item.angle)[item.positions.start];
        let mut part_from_grip = work::frame(site, place, angle);
        part_from_grip.rotation *= jaws.turn();
        let mut faces = [0, 1].map(|side| site.face_at(side, self.part, place));
        if jaws == Jaws::Exchanged {
            faces.reverse();
        }
        Negative {
            id: item.id + u64::from(jaws == Jaws::Exchanged),
            part_from_grip,
            width: site.width,
            face_i: faces[0],
            face_ii: faces[1],
            angle,
            inside: site.kind == PairKind::Internal,
            reason,
        }
    }
}

/// Leaves the first `most` of each reason, in the order of their scattered numbers.
fn keep<T>(all: &mut Vec<T>, most: usize, pose: impl Fn(&T) -> &Negative) {
    all.sort_by_key(|one| scatter(pose(one).id));
    let mut counts = BTreeMap::<String, usize>::new();
    all.retain(|one| {
        let count = counts.entry(pose(one).reason.clone()).or_default();
        *count += 1;
        *count <= most
    });
}

/// The `count` numbers that come most often; of those that come equally often the smaller ones.
fn commonest(numbers: impl Iterator<Item = usize>, count: usize) -> Vec<usize> {
    let mut times = BTreeMap::<usize, usize>::new();
    numbers.for_each(|number| *times.entry(number).or_default() += 1);
    let mut order: Vec<(usize, usize)> = times.into_iter().collect();
    order.sort_by_key(|&(number, times)| (std::cmp::Reverse(times), number));
    order.into_iter().take(count).map(|(number, _)| number).collect()
}

/// A number that looks random, another one for each `number` (the finaliser of SplitMix64).
pub fn scatter(number: u64) -> u64 {
    let mut x = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The numbers below `count`, each once, in a fixed pseudo-random order: a Feistel network over the
/// next power of four, less the numbers beyond.
fn shuffled(count: u64) -> impl Iterator<Item = u64> {
    let half = (64 - count.saturating_sub(1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1_u64 << half) - 1;
    let place = move |number: u64| {
        let (left, right) = (0..4).fold((number >> half, number & mask), |(left, right), round| {
            (right, left ^ (scatter((right << 2) + round) & mask))
        });
        (left << half) | right
    };
    (0..=(mask << half) | mask).map(place).filter(move |number| *number < count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_once() {
        for count in [0, 1, 2, 3, 4, 5, 16, 17, 1000, 4096] {
            let mut numbers: Vec<u64> = shuffled(count).collect();
            if count > 100 {
                // The first tenth reaches everywhere.
                let few = &numbers[..count as usize / 10];
                for part in 0..5 {
                    let range = part * count / 5..(part + 1) * count / 5;
                    assert!(few.iter().filter(|number| range.contains(number)).count() > 5);
                }
            }
            numbers.sort_unstable();
            assert_eq!(numbers, (0..count).collect::<Vec<_>>());
        }
    }
}
