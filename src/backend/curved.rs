//! Grips on what is not plane: on the processor, every load solved to the end.
//!
//! The seed stage knows the twists of planes only. The slip problem of a round part has up to five
//! dimensions, and its answer is mostly at a crease that is tested first.

use rayon::prelude::*;

use super::score::{Scored, TIE, usable};
use crate::mechanics::curved::Pads;
use crate::mechanics::refused;
use crate::model::{Score, Status, Wrench};
use crate::request::Polish;

/// A grip on surfaces and its loads.
#[derive(Debug, Clone, Copy)]
pub struct CurvedProblem<'a> {
    /// The surfaces made ready; `None` where there is no contact.
    pub pads: Option<&'a Pads>,
    /// Height of face I over face II \[m\], negative from inside.
    pub distance: f64,
    /// Gripping force \[N\].
    pub force: f64,
    /// Loads in the grip frame about its origin.
    pub wrenches: &'a [Wrench],
}

/// The worst load of each grip, in order; under [`Polish::All`] all of them. The answers do not
/// depend on the number of threads.
pub fn score_curved(problems: &[CurvedProblem<'_>], polish: Polish) -> Vec<Scored> {
    problems.par_iter().map(|problem| problem.score(polish)).collect()
}

impl CurvedProblem<'_> {
    fn score(&self, polish: Polish) -> Scored {
        let mut all = Vec::with_capacity(self.wrenches.len());
        let mut worst: Option<(usize, Score)> = None;
        for (load, wrench) in self.wrenches.iter().enumerate() {
            let score = match self.pads {
                Some(pads) => pads.solve(self.distance, self.force, wrench).score,
                None => refused(Status::NoContact, 0),
            };
            all.push(score);
            // A load that is not held is the worst; else the first of the largest.
            let worse = match (worst.map(|(_, known)| usable(&known)), usable(&score)) {
                (None, _) | (Some(Some(_)), None) => true,
                (Some(None), _) => false,
                (Some(Some(known)), Some(mu)) => mu > known * (1.0 + TIE),
            };
            if worse {
                worst = Some((load, score));
            }
            if polish != Polish::All && usable(&score).is_none() {
                break;
            }
        }
        let solved = all.len();
        if polish != Polish::All {
            all.clear();
        }
        Scored { worst, all, solved, compared: 0, outranked: false }
    }
}
