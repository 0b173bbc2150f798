//! STEP, by Open CASCADE: exact surfaces tessellated on reading.

use std::ffi::{CStr, c_char, c_double, c_int, c_void};
use std::io::Read;

use glam::DVec3;

use super::Source;
use crate::error::Result;
use crate::part::unit::Unit;
use crate::part::weld::{Soup, Welder};

/// Largest distance of the triangles from a curved surface: this share of the part's diagonal, ...
const DEFLECTION_SHARE: f64 = 1e-4;
/// ... at most this [mm]. Planar faces are exact but for their curved edges.
const DEFLECTION_MOST: f64 = 0.05;
/// Largest angle between neighbouring triangles of a curved surface [rad].
const DEFLECTION_ANGLE: f64 = 0.2;

#[allow(unsafe_code, reason = "the C++ side of this reader; its contract stands in step.cpp")]
unsafe extern "C" {
    fn gripfast_step(
        data: *const c_char,
        size: usize,
        share: c_double,
        most: c_double,
        angle: c_double,
        user: *mut c_void,
        triangle: extern "C" fn(*mut c_void, *const c_double),
        message: *mut c_char,
        room: usize,
    ) -> c_int;
}

#[allow(
    unsafe_code,
    reason = "called back with the welder and nine numbers that `read` and step.cpp own for the call"
)]
extern "C" fn take(user: *mut c_void, nine: *const c_double) {
    let (welder, nine) = unsafe { (&mut *user.cast::<Welder>(), &*nine.cast::<[[f64; 3]; 3]>()) };
    welder.triangle(nine.map(DVec3::from_array));
}

/// Reads and tessellates. The kernel converts the file's unit to millimetres.
pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let mut bytes = Vec::new();
    if let Err(fault) = source.reader.read_to_end(&mut bytes) {
        return Err(source.fault(fault));
    }
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(256)]);
    if !start.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']).starts_with("ISO-10303-21") {
        return Err(source.bad(
            "is not a STEP file: it does not begin with ISO-10303-21",
            "export the part again",
        ));
    }
    let mut welder = Welder::default();
    let mut message = [0_u8; 256];
    #[allow(
        unsafe_code,
        reason = "pointers and lengths of live buffers; the callback gets the welder back"
    )]
    let left_out = unsafe {
        gripfast_step(
            bytes.as_ptr().cast(),
            bytes.len(),
            DEFLECTION_SHARE,
            DEFLECTION_MOST,
            DEFLECTION_ANGLE,
            (&raw mut welder).cast(),
            take,
            message.as_mut_ptr().cast(),
            message.len(),
        )
    };
    if left_out < 0 {
        let message = CStr::from_bytes_until_nul(&message)
            .map_or_else(|_| "unreadable".into(), CStr::to_string_lossy);
        return Err(source.bad(
            format!("cannot be read as STEP: {message}"),
            "export the part again as STEP AP203, AP214 or AP242, or as a mesh",
        ));
    }
    source.check_count(&welder)?;
    let warnings = match left_out {
        0 => Vec::new(),
        1 => vec!["1 face of the STEP file could not be tessellated and is missing".to_string()],
        many => {
            vec![format!("{many} faces of the STEP file could not be tessellated and are missing")]
        }
    };
    Ok(welder.finish(Some(Unit::Millimetre), warnings))
}
