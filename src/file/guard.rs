//! A panic in a foreign reader is an error, not the end of the program.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use crate::error::{Error, Result};

thread_local! {
    /// Set while a foreign reader runs on this thread: its panic is not printed.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

static HOOK: Once = Once::new();

/// Runs a reader of foreign code; a panic in it becomes bad input at `place`. What the reader has
/// half done is dropped with it.
pub(crate) fn guarded<T>(place: &str, read: impl FnOnce() -> Result<T>) -> Result<T> {
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |information| {
            if !GUARDED.get() {
                before(information);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(outer);
    outcome.unwrap_or_else(|panic| {
        let text = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied())
            .unwrap_or("no reason given");
        Err(Error::format(
            place,
            format!("the reader of this format failed: {text}"),
            "repair the file or export it again",
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_an_error_and_answers_pass() {
        assert_eq!(guarded("x", || Ok(3)).unwrap(), 3);
        let error = guarded::<()>("x.obj", || panic!("index 5")).unwrap_err();
        assert!(error.to_string().starts_with("x.obj: ") && error.to_string().contains("index 5"));
        assert!(!GUARDED.get());
        assert!(std::panic::catch_unwind(|| panic!("not of a reader")).is_err());
    }
}
