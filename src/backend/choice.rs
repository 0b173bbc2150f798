//! Which backend: what was asked for, what was taken, and why.

use super::Backend;
use crate::error::{Error, ErrorKind, Result};
use crate::request::Choice;

/// A backend and the reason for it, for people.
#[derive(Debug)]
#[non_exhaustive]
pub struct Selection {
    /// Ready to use.
    pub backend: Backend,
    /// One line.
    pub reason: String,
}

/// Opens what was asked for. `adapter` names the GPU (index or part of its name); without it the
/// environment variable `GRIPFAST_ADAPTER` does.
///
/// # Errors
/// A device error when `gpu` was asked for and there is none, or a named adapter does not exist
/// or does not work (whatever the choice: a name is never silently ignored); a bad value
/// for an adapter named with `cpu`.
pub fn select(choice: Choice, adapter: Option<&str>) -> Result<Selection> {
    match choice {
        Choice::Cpu if adapter.is_some() => Err(Error::input(
            "adapter",
            "is named together with the backend cpu",
            "leave out one of them",
        )
        .with_options(&["adapter", "backend"])),
        Choice::Cpu => Ok(Selection { backend: Backend::Cpu, reason: "cpu: asked for".to_owned() }),
        Choice::Auto | Choice::Gpu => open(choice, adapter),
    }
}

#[cfg(feature = "gpu")]
fn open(choice: Choice, adapter: Option<&str>) -> Result<Selection> {
    match super::Gpu::open(adapter, choice == Choice::Gpu) {
        Ok(gpu) => {
            let software =
                if gpu.is_software() { " (software: right answers, no speed)" } else { "" };
            let named = adapter.is_some() || named_in_environment();
            let why = if choice == Choice::Gpu || named { "asked for" } else { "auto, found" };
            Ok(Selection {
                reason: format!("gpu: {why} {}{software}", gpu.name()),
                backend: Backend::Gpu(Box::new(gpu)),
            })
        }
        Err(error)
            if error.kind() == ErrorKind::Device
                && choice == Choice::Auto
                && adapter.is_none()
                && !named_in_environment() =>
        {
            Ok(Selection {
                backend: Backend::Cpu,
                reason: format!("cpu: auto, {}", error.problem()),
            })
        }
        Err(error) => Err(error),
    }
}

#[cfg(feature = "gpu")]
fn named_in_environment() -> bool {
    std::env::var(super::ADAPTER_VARIABLE).is_ok_and(|name| !name.trim().is_empty())
}

#[cfg(not(feature = "gpu"))]
fn open(choice: Choice, adapter: Option<&str>) -> Result<Selection> {
    if choice == Choice::Auto && adapter.is_none() {
        return Ok(Selection {
            backend: Backend::Cpu,
            reason: "cpu: auto, this build has no GPU support".to_owned(),
        });
    }
    Err(Error::device("this build has no GPU support (cargo feature `gpu`)")
        .with_kind(ErrorKind::Unsupported))
}
