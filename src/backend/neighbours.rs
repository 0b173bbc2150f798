//! States of loads on one grip, and which of them is like another load's.

use crate::contact::{PlaneWrench, widest};
use crate::mechanics::{Load, Neighbour};

/// States found of some loads, for the next ones to begin at. No more than [`MOST`] and none much
/// like another, so that finding the nearest does not grow with the number of loads.
#[derive(Default)]
pub(super) struct Neighbours {
    /// Per coordinate of a load's place, the loads'.
    places: Places,
    pub(super) states: Vec<Neighbour>,
}

/// States kept of one grip.
const MOST: usize = 128;
/// Square of the distance in units of the gripping force from which on a load's state is kept.
const UNLIKE: f32 = 0.05 * 0.05;
/// Square of the distance up to which a state helps.
pub(super) const LIKE: f32 = 0.5 * 0.5;

impl Neighbours {
    /// The square of the distance of the nearest state, and which it is.
    pub(super) fn nearest(&self, place: &[f32; 6]) -> Option<(f32, usize)> {
        let (apart, index) = nearest(&self.places, self.states.len(), place);
        (index < self.states.len()).then_some((apart, index))
    }

    /// Whether to keep a state whose nearest other one is so far, by the square of the distance.
    pub(super) fn lacks(&self, apart: f32) -> bool {
        apart > UNLIKE && self.states.len() < MOST
    }

    pub(super) fn add(&mut self, place: [f32; 6], state: Neighbour) {
        let index = self.states.len();
        for (all, x) in self.places.0[index / SIDE].iter_mut().zip(place) {
            all[index % SIDE] = x;
        }
        self.states.push(state);
    }
}

/// Places looked at side by side.
const SIDE: usize = 16;

/// Places of up to [`MOST`] loads: some side by side, coordinate by coordinate.
struct Places([[[f32; SIDE]; 6]; MOST / SIDE]);

impl Default for Places {
    fn default() -> Self {
        Self([[[f32::INFINITY; SIDE]; 6]; MOST / SIDE])
    }
}

widest! {
    /// The square of the distance of the nearest of `count` places, and its index; beyond them where
    /// there are none.
    fn nearest(places: &Places, count: usize, place: &[f32; 6]) -> (f32, usize) = nearest_of
}

#[inline(always)]
fn nearest_of(Places(places): &Places, count: usize, place: &[f32; 6]) -> (f32, usize) {
    let mut least = [f32::INFINITY; SIDE];
    let mut at = [u32::MAX; SIDE];
    for (chunk, some) in places.iter().enumerate().take(count.div_ceil(SIDE)) {
        let mut apart = [0.0_f32; SIDE];
        for m in 0..6 {
            for i in 0..SIDE {
                let way = place[m] - some[m][i];
                apart[i] += way * way;
            }
        }
        for i in 0..SIDE {
            let nearer = apart[i] < least[i];
            least[i] = if nearer { apart[i] } else { least[i] };
            at[i] = if nearer { (chunk * SIDE + i) as u32 } else { at[i] };
        }
    }
    // By halves, of equal ones the first.
    let mut half = SIDE / 2;
    while half > 0 {
        for i in 0..half {
            let (other, to) = (least[half + i], at[half + i]);
            let nearer = (other < least[i]) | ((other == least[i]) & (to < at[i]));
            least[i] = if nearer { other } else { least[i] };
            at[i] = if nearer { to } else { at[i] };
        }
        half /= 2;
    }
    (least[0], at[0] as usize)
}

/// Where a load is among others.
pub(super) fn place(load: &Load) -> [f32; 6] {
    let PlaneWrench { f1, f2, m3 } = load.direction;
    [f1, f2, m3, load.moment[0], load.moment[1], load.normal[0]].map(|x| x as f32)
}
