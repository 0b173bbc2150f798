//! A race for the best grips: those whose bounds show that they cannot be among them are not solved
//! to the end.

use rayon::prelude::*;

use super::job::Backend;
use super::problem::Batch;
use super::score::{BLOCK, Block, Case, ScoreOptions, Scored, cases, usable};
use super::seeds::SeedSet;
use super::watch::Watch;
use crate::error::Result;

/// A merit this share below that of the last of the best still counts as one of them: far above
/// what answers from different seeds differ by, and what counts as a tie in the order of the grips.
const MARGIN: f64 = 1e-6;

/// Grips solved before the merits found are looked at again: few at first, when most is learnt from
/// each, then more.
const ROUNDS: std::ops::RangeInclusive<usize> = 64..=1024;

/// The merits of the best grips so far, over any number of batches.
#[derive(Debug, Clone)]
pub struct Best {
    keep: usize,
    /// Falling, at most `keep`.
    merits: Vec<f64>,
}

impl Best {
    /// Of `keep` grips (at least one).
    pub fn new(keep: usize) -> Self {
        Self { keep: keep.max(1), merits: Vec::new() }
    }

    /// Takes the merit of a grip that holds.
    pub fn insert(&mut self, merit: f64) {
        let place = self.merits.partition_point(|&other| other >= merit);
        self.merits.insert(place, merit);
        self.merits.truncate(self.keep);
    }

    /// Whether a grip with no more than this merit is surely not among the best.
    pub fn beats(&self, merit: f64) -> bool {
        self.merits.len() == self.keep
            && self.merits.last().is_some_and(|&last| merit < last - MARGIN * last.abs())
    }
}

impl Backend {
    /// As [`Backend::score`] under [`super::Polish::Worst`], but grips that cannot be among the
    /// `best` are left unsolved ([`Scored::outranked`]). `merit` values a grip (by its place in the
    /// batch) by the `mu_s` of its worst load, and must not rise with it. The most promising grips
    /// of a batch are solved first.
    ///
    /// The best grips and their answers are those of [`Backend::score`]. How many others are solved
    /// too depends on how the grips are cut into batches, not on the number of threads.
    ///
    /// # Errors
    /// As [`Backend::seed`].
    pub fn score_best(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        options: &ScoreOptions,
        best: &mut Best,
        merit: &(dyn Fn(usize, f64) -> f64 + Sync),
    ) -> Result<Vec<Scored>> {
        let score = |watch: &Watch<'_>| {
            self.score_best_watched(batch, seeds, options, (best, merit), watch)
        };
        Ok(Watch::none(score)?.into_iter().flatten().collect())
    }

    /// As [`Backend::score_best`], as far as `watch` does not stop it: `None` for the other grips.
    pub(crate) fn score_best_watched(
        &self,
        batch: &Batch<'_>,
        seeds: &SeedSet,
        options: &ScoreOptions,
        (best, merit): (&mut Best, &(dyn Fn(usize, f64) -> f64 + Sync)),
        watch: &Watch<'_>,
    ) -> Result<Vec<Option<Scored>>> {
        self.by_blocks(
            (BLOCK, options.wanted()),
            batch,
            seeds,
            |Block { range, contacts, survivors }| {
                let cases = cases(&contacts, &batch.problems[range.clone()], &survivors, options);
                let merit = |index: usize, mu: f64| merit(range.start + index, mu);
                let lower = |(index, case): (usize, &Case<'_>)| merit(index, case.lower());
                let promise = cases.par_iter().enumerate().map(lower).collect();
                let score = |index: usize, beaten: &Beaten<'_>| {
                    watch.scored(|| cases[index].score(Some(beaten)))
                };
                race(promise, best, &merit, &score)
            },
        )
    }
}

/// The answer of a grip by its place, which may end as soon as its friction is beaten; `None` where it
/// is stopped.
type Entry<'a> = &'a (dyn Fn(usize, &Beaten<'_>) -> Option<Scored> + Sync);
/// Whether a grip that needs this friction at least is surely not among the best.
pub(super) type Beaten<'a> = dyn Fn(f64) -> bool + Sync + 'a;

/// Scores grips, those that promise the greatest merits first.
pub(super) fn race(
    promise: Vec<f64>,
    best: &mut Best,
    merit: &(dyn Fn(usize, f64) -> f64 + Sync),
    score: Entry<'_>,
) -> Vec<Option<Scored>> {
    let mut scored: Vec<Option<Scored>> = vec![None; promise.len()];
    let mut order: Vec<(f64, usize)> = promise.into_iter().zip(0..).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let (mut rest, mut round) = (order.as_slice(), *ROUNDS.start());
    while !rest.is_empty() {
        let (now, later) = rest.split_at(round.min(rest.len()));
        let known = &*best;
        let answers: Vec<Option<Scored>> = now
            .par_iter()
            .map(|&(_, index)| score(index, &|mu| known.beats(merit(index, mu))))
            .collect();
        for (&(_, index), answer) in now.iter().zip(answers) {
            let worst = answer.as_ref().and_then(|answer| answer.worst.as_ref());
            if let Some(mu) = worst.and_then(|(_, score)| usable(score)) {
                best.insert(merit(index, mu));
            }
            scored[index] = answer;
        }
        (rest, round) = (later, (2 * round).min(*ROUNDS.end()));
    }
    scored
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_merits_are_kept_and_near_ties_are_not_beaten() {
        let mut best = Best::new(3);
        for merit in [1.0, 5.0, 3.0] {
            assert!(!best.beats(0.0));
            best.insert(merit);
        }
        assert!(
            best.beats(0.5)
                && !best.beats(1.0 - 1e-9)
                && !best.beats(1.0)
                && !best.beats(f64::INFINITY)
        );
        best.insert(4.0);
        assert!(best.beats(2.9) && !best.beats(3.0));
        best.insert(2.0);
        assert!(best.beats(2.9) && !best.beats(3.0));
        // Negative merits: below is below.
        let mut best = Best::new(1);
        best.insert(-2.0);
        assert!(best.beats(-2.1) && !best.beats(-1.9) && !best.beats(-2.0 - 1e-9));
        assert!(!Best::new(0).beats(f64::NEG_INFINITY));
    }
}
