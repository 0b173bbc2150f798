//! Gripper files.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    if let Ok(text) = std::str::from_utf8(data)
        && let Ok(gripper) = gripfast::gripper::file::parse(text, "fuzz")
    {
        gripfast::gripper::check(&gripper);
        gripfast::gripper::drawing::svg(&gripper);
    }
});
