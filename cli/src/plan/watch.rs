//! A run as its user sees it: a progress bar, notes, warnings, and the interrupt that stops it.

use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use gripfast::plan::{Observer, Progress};
use indicatif::{ProgressBar, ProgressStyle};

use crate::flags;

/// Notes and progress to standard error unless quiet; warnings always.
pub(super) struct Watch {
    quiet: bool,
    bar: Option<ProgressBar>,
}

impl Watch {
    pub(super) fn new(quiet: bool) -> Self {
        Self { quiet, bar: None }
    }

    /// Takes the bar away.
    pub(super) fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    /// A line above the bar.
    fn line(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| eprintln!("{text}")),
            None => eprintln!("{text}"),
        }
    }
}

impl Observer for Watch {
    fn progress(&mut self, progress: Progress) {
        let (quiet, first) = (self.quiet, self.bar.is_none());
        let bar = self.bar.get_or_insert_with(|| progress_bar(progress.total, quiet));
        bar.set_position(progress.done);
        if first {
            bar.reset_eta();
        } else {
            bar.set_message(format!("{} grips", progress.grips));
        }
    }

    fn note(&mut self, text: &str) {
        if !self.quiet {
            self.line(text);
        }
    }

    fn warning(&mut self, text: &str) {
        self.line(&format!("warning: {}", flags::warning(text)));
    }
}

/// A bar with rate and time left; hidden when asked for or when nobody watches.
fn progress_bar(total: u64, quiet: bool) -> ProgressBar {
    if quiet || !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(total);
    if let Ok(style) = ProgressStyle::with_template(
        "{bar:32} {human_pos}/{human_len} candidates  {per_sec}  {eta} left  {msg}",
    ) {
        bar.set_style(style);
    }
    bar
}

/// Set when the user asks to stop: the run ends after the chunk in flight with what it has.
pub(super) fn stop_on_interrupt() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    // A second handler in one process is refused; then an interrupt just ends the program, which is
    // all right too.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    stop
}
