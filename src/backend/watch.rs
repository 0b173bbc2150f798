//! A long call seen and stopped from outside.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::score::Scored;

/// Time between two looks at how far a call has come.
const PAUSE: Duration = Duration::from_millis(200);

/// Stops the scoring of grips, and tells how many are scored.
pub struct Watch<'a> {
    stop: &'a AtomicBool,
    scored: AtomicUsize,
    teller: Mutex<Teller<'a>>,
}

struct Teller<'a> {
    tell: &'a mut (dyn FnMut(usize) + Send),
    last: Instant,
}

impl<'a> Watch<'a> {
    /// `stop`: set once the grips that are left shall stay unscored. `tell` is called now and then
    /// with the number scored so far, which never falls.
    pub fn new(stop: &'a AtomicBool, tell: &'a mut (dyn FnMut(usize) + Send)) -> Self {
        let teller = Mutex::new(Teller { tell, last: Instant::now() });
        Self { stop, scored: AtomicUsize::new(0), teller }
    }

    /// Makes a call that nobody sees or stops.
    pub(crate) fn none<T>(call: impl FnOnce(&Watch<'_>) -> T) -> T {
        call(&Watch::new(&AtomicBool::new(false), &mut |_| ()))
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Scores a grip and counts it, unless it is stopped.
    pub(crate) fn scored(&self, score: impl FnOnce() -> Scored) -> Option<Scored> {
        if self.is_stopped() {
            return None;
        }
        let scored = score();
        self.count();
        Some(scored)
    }

    fn count(&self) {
        self.scored.fetch_add(1, Ordering::Relaxed);
        // Whoever tells at the moment tells for all.
        let Ok(mut teller) = self.teller.try_lock() else { return };
        if teller.last.elapsed() >= PAUSE {
            (teller.tell)(self.scored.load(Ordering::Relaxed));
            teller.last = Instant::now();
        }
    }
}

impl std::fmt::Debug for Watch<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Watch").field("scored", &self.scored).finish_non_exhaustive()
    }
}
