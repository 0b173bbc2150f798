//! The `gripfast` program.

mod cli;

fn main() -> std::process::ExitCode {
    quiet_vulkan();
    cli::main()
}

/// Without a desktop, Mesa's Vulkan layer that asks the display server for the preferred adapter
/// prints an error for every look at the adapters. gripfast ranks them itself, so the layer is
/// switched off there.
fn quiet_vulkan() {
    let absent = |name: &str| std::env::var_os(name).is_none();
    if cfg!(all(feature = "gpu", target_os = "linux"))
        && absent("XDG_RUNTIME_DIR")
        && absent("NODEVICE_SELECT")
    {
        #[allow(
            unsafe_code,
            reason = "the first statement of the program: no other thread reads the environment"
        )]
        unsafe {
            std::env::set_var("NODEVICE_SELECT", "1");
        }
    }
}
