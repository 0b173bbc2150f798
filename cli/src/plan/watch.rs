//! A run as its user sees it: a progress bar, notes, warnings, and the interrupt that stops it.

use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use gripfast::plan::{Observer, Progress};
use indicatif::{HumanCount, HumanDuration, ProgressBar, ProgressState, ProgressStyle};

use crate::{flags, terminal};

/// Notes and progress to standard error unless quiet; warnings always.
pub(super) struct Watch {
    quiet: bool,
    bar: Option<ProgressBar>,
    /// Where a bar cannot be drawn.
    log: Option<Log>,
    /// What the notes are about, where there are several plans.
    about: String,
    /// Warnings that were given.
    given: Vec<String>,
    /// See [`Interrupt::at_once`].
    at_once: Option<Arc<AtomicBool>>,
}

impl Watch {
    pub(super) fn new(quiet: bool) -> Self {
        Self { quiet, bar: None, log: None, about: String::new(), given: Vec::new(), at_once: None }
    }

    /// From now on notes are about this plan.
    pub(super) fn about(&mut self, name: &str) {
        self.about = format!("{name}: ");
    }

    /// An interrupt ends the program at once until the search has begun.
    pub(super) fn hold(&mut self, interrupt: &Interrupt) {
        interrupt.at_once.store(true, Ordering::Relaxed);
        self.at_once = Some(Arc::clone(&interrupt.at_once));
    }

    /// Takes the bar away.
    pub(super) fn end(&mut self) {
        self.log = None;
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    /// A line above the bar.
    fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| terminal::say(text)),
            None => terminal::say(text),
        }
    }
}

impl Observer for Watch {
    fn progress(&mut self, progress: Progress) {
        if let Some(at_once) = self.at_once.take() {
            at_once.store(false, Ordering::Relaxed);
        }
        let (quiet, first) = (self.quiet, self.bar.is_none());
        let bar = self.bar.get_or_insert_with(|| progress_bar(progress.total, quiet));
        bar.set_position(progress.done);
        if first {
            bar.reset_eta();
            self.log = (!quiet && !drawn()).then(|| Log::new(progress.done));
        } else {
            bar.set_message(format!("{} grips", progress.grips));
        }
        if let Some(text) = self.log.as_mut().and_then(|log| {
            log.line([progress.done, progress.total, progress.grips], Instant::now())
        }) {
            terminal::say(&format!("{}{text}", self.about));
        }
    }

    fn finishing(&mut self, done: usize, grips: usize) {
        if let Some(bar) = &self.bar {
            bar.set_message(match done {
                0 => format!("completing {grips} grips"),
                _ => format!("completing {grips} grips: {} %", 100 * done / grips),
            });
        }
        if let Some(text) =
            self.log.as_mut().and_then(|log| log.completing([done, grips], Instant::now()))
        {
            terminal::say(&format!("{}{text}", self.about));
        }
    }

    fn note(&mut self, text: &str) {
        if !self.quiet {
            self.line(&format!("{}{text}", self.about));
        }
    }

    fn warning(&mut self, text: &str) {
        // Of several plans the same part is warned of once.
        if !self.given.iter().any(|known| known == text) {
            self.given.push(text.to_owned());
            self.line(&format!("warning: {}", flags::warning(text)));
        }
    }
}

/// Whether somebody sees a bar.
fn drawn() -> bool {
    std::io::stderr().is_terminal()
}

/// Lines about a long run, for a file or a pipe.
struct Log {
    begun: Instant,
    /// Candidates that an earlier run had done.
    before: u64,
    next: Instant,
}

impl Log {
    /// Before the first line, and after that between two.
    const FIRST: Duration = Duration::from_secs(10);
    const PAUSE: Duration = Duration::from_secs(30);

    fn new(before: u64) -> Self {
        let begun = Instant::now();
        Self { begun, before, next: begun + Self::FIRST }
    }

    /// Whether it is time for a line; the next one is due later.
    fn is_due(&mut self, now: Instant) -> bool {
        let due = now >= self.next;
        if due {
            self.next = now + Self::PAUSE;
        }
        due
    }

    /// How many of the grips found have all their numbers, where it is time to say it.
    fn completing(&mut self, [done, grips]: [usize; 2], now: Instant) -> Option<String> {
        if !self.is_due(now) {
            return None;
        }
        Some(format!(
            "all candidates looked at; {} of {} grips have their forces",
            HumanCount(done as u64),
            HumanCount(grips as u64)
        ))
    }

    /// How far the run is, where it is time to say it.
    fn line(&mut self, [done, total, grips]: [u64; 3], now: Instant) -> Option<String> {
        if done >= total || !self.is_due(now) {
            return None;
        }
        let left = match done - self.before {
            0 => String::new(),
            since => {
                let left = (now - self.begun).mul_f64((total - done) as f64 / since as f64);
                format!("; about {} left", HumanDuration(left))
            }
        };
        Some(format!(
            "{} of {} candidates, {} grips{left}",
            HumanCount(done),
            HumanCount(total),
            HumanCount(grips)
        ))
    }
}

/// A bar with rate and time left; hidden when asked for or when nobody watches.
fn progress_bar(total: u64, quiet: bool) -> ProgressBar {
    if quiet || !drawn() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template(
        "{bar:32} {human_pos}/{human_len} candidates  {rate}/s  {eta} left  {msg}",
    ) {
        let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            // Nobody reads decimals of it.
            let _ = write!(out, "{}", HumanCount(state.per_sec() as u64));
        };
        bar.set_style(style.with_key("rate", rate));
    }
    bar
}

/// A request to stop from outside: the run ends after the grips in flight with what it has; a
/// second one ends the program at once.
pub(crate) struct Interrupt {
    /// Set by the first one.
    pub(crate) stop: Arc<AtomicBool>,
    /// Whether the next one ends the program at once: there is nothing yet to be kept, or it is the
    /// second.
    at_once: Arc<AtomicBool>,
    /// The exit code that it asks for, 0 without one.
    code: Arc<AtomicUsize>,
}

impl Interrupt {
    /// From now on interrupts are taken.
    pub(crate) fn watched() -> std::io::Result<Self> {
        use signal_hook::consts::{SIGINT, SIGTERM};
        use signal_hook::flag;
        let (stop, at_once) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let code = Arc::<AtomicUsize>::default();
        for signal in [SIGINT, SIGTERM] {
            // As shells number them: 130 and 143.
            let ends = 128 + signal;
            flag::register_conditional_shutdown(signal, ends, Arc::clone(&at_once))?;
            flag::register_usize(signal, Arc::clone(&code), ends as usize)?;
            flag::register(signal, Arc::clone(&stop))?;
            flag::register(signal, Arc::clone(&at_once))?;
        }
        Ok(Self { stop, at_once, code })
    }

    /// The exit code of an interrupted program.
    pub(crate) fn code(&self) -> Option<u8> {
        u8::try_from(self.code.load(Ordering::Relaxed)).ok().filter(|&code| code > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_run_is_told_of_now_and_then() {
        let mut log = Log::new(100);
        let begun = log.begun;
        let mut at = |seconds: u64, done: u64| {
            log.line([done, 2100, 1234], begun + Duration::from_secs(seconds))
        };
        assert_eq!(at(9, 300), None);
        let text = "600 of 2,100 candidates, 1,234 grips; about 60 seconds left";
        assert_eq!(at(20, 600).as_deref(), Some(text));
        assert_eq!(at(49, 700), None);
        assert!(at(50, 800).is_some());
        assert_eq!(at(100, 2100), None, "the answer follows at once");
    }
}
