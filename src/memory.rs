//! How much memory input may take: a stated limit, checked before the memory is taken.

use std::cell::Cell;

use crate::error::{Error, ErrorKind, Result};

/// The limit where the machine does not say how much memory it has \[bytes\].
const UNKNOWN: u64 = 4 << 30;

/// The default limit \[bytes\]: half of the machine's memory, or of what the system's control group
/// grants; 4 GiB where neither is known.
pub fn default_limit() -> u64 {
    machine().map_or(UNKNOWN, |bytes| bytes / 2)
}

/// Memory of the machine or of the control group, the smaller one \[bytes\].
fn machine() -> Option<u64> {
    let information = std::fs::read_to_string("/proc/meminfo").ok();
    let total = information.as_deref().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
    });
    let granted =
        ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"].iter();
    let granted =
        granted.filter_map(|file| std::fs::read_to_string(file).ok()?.trim().parse::<u64>().ok());
    granted.chain(total).min()
}

/// Memory taken for one input against its limit.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    held: Cell<u64>,
}

impl Budget {
    /// `limit` bytes, the default one when absent.
    pub(crate) fn new(limit: Option<u64>) -> Self {
        Self { limit: limit.unwrap_or_else(default_limit), held: Cell::new(0) }
    }

    /// The limit \[bytes\].
    pub(crate) fn limit(&self) -> u64 {
        self.limit
    }

    /// Takes `bytes` until the end of the input.
    ///
    /// # Errors
    /// [`ErrorKind::Limit`] when they do not fit.
    pub(crate) fn hold(&self, place: &str, bytes: u64) -> Result<()> {
        self.room(place, bytes)?;
        self.held.set(self.held.get() + bytes);
        Ok(())
    }

    /// Whether `bytes` more fit.
    ///
    /// # Errors
    /// [`ErrorKind::Limit`] when they do not.
    pub(crate) fn room(&self, place: &str, bytes: u64) -> Result<()> {
        let needed = self.held.get().saturating_add(bytes);
        if needed > self.limit { Err(self.exceeded(place, needed)) } else { Ok(()) }
    }

    /// The error of an input that needs `needed` bytes or more.
    pub(crate) fn exceeded(&self, place: &str, needed: u64) -> Error {
        Error::new(
            ErrorKind::Limit,
            place,
            format!(
                "needs {} or more of memory; the limit is {}",
                readable(needed),
                readable(self.limit)
            ),
            "make it smaller (a coarser mesh, fewer copies), or allow more memory",
        )
        .with_options(&["max_memory"])
    }
}

/// Bytes for people: `56 kB`, `3.2 GB`.
fn readable(bytes: u64) -> String {
    const NAMES: [&str; 6] = ["B", "kB", "MB", "GB", "TB", "PB"];
    let (mut value, mut name) = (bytes as f64, 0);
    while value >= 999.5 && name + 1 < NAMES.len() {
        (value, name) = (value / 1e3, name + 1);
    }
    let decimals = usize::from(value < 9.95 && name > 0);
    format!("{value:.decimals$} {}", NAMES[name])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_budget_ends_at_its_limit() {
        let budget = Budget::new(Some(100));
        budget.hold("x", 60).unwrap();
        budget.room("x", 40).unwrap();
        let error = budget.hold("x", 41).unwrap_err();
        assert_eq!((error.kind(), error.options()), (ErrorKind::Limit, ["max_memory"].as_slice()));
        assert!(budget.room("x", u64::MAX).is_err());
        assert!(error.to_string().contains("101 B"), "{error}");
    }

    #[test]
    fn sizes_are_readable_and_the_default_is_a_share_of_the_machine() {
        assert_eq!(readable(999), "999 B");
        assert_eq!(readable(56_000), "56 kB");
        assert_eq!(readable(3_200_000_000), "3.2 GB");
        assert!(default_limit() >= 64 << 20);
    }
}
