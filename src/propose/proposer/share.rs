//! Some of the candidates of a run, as one of several machines looks at them.

use super::Proposer;

/// One of several stretches of the candidates, about equal and following each other. Work items stay
/// whole, because contacts are shared within them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Share {
    number: u64,
    of: u64,
    /// Places in all.
    places: u64,
    /// Places that have gone by.
    passed: u64,
}

impl Share {
    /// Whether the item of the next `count` places belongs to it.
    pub(super) fn takes(&mut self, count: usize) -> bool {
        let start = u128::from(self.passed);
        self.passed += count as u64;
        start * u128::from(self.of) / u128::from(self.places.max(1)) == u128::from(self.number)
    }
}

impl Proposer<'_> {
    /// Leaves only the share `number`, from 0, of `of` shares that follow each other. Its grips, their
    /// numbers and their contacts are those that the whole stream has there. To be called before the
    /// first chunk.
    pub fn take_share(&mut self, number: usize, of: usize) {
        let places = self.candidates() / self.orientations().len() as u64;
        self.share = Some(Share { number: number as u64, of: of as u64, places, passed: 0 });
    }
}
