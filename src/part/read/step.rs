//! STEP, by Open CASCADE: exact surfaces tessellated on reading; in this process, or in one of its
//! own that its faults cannot leave.

use std::ffi::{CStr, c_char, c_double, c_int, c_void};
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Mutex, OnceLock, PoisonError};

use glam::DVec3;

use super::Source;
use crate::error::{Error, ErrorKind, Result};
use crate::part::given::Stated;
use crate::part::weld::{Soup, Welder};
use crate::units::Unit;

/// Largest distance of the triangles from a curved surface: this share of the part's diagonal, ...
const DEFLECTION_SHARE: f64 = 1e-4;
/// ... at most this [mm]. Planar faces are exact but for their curved edges.
const DEFLECTION_MOST: f64 = 0.05;
/// Largest angle between neighbouring triangles of a curved surface \[rad\].
const DEFLECTION_ANGLE: f64 = 0.2;

const REMEDY: &str = "export the part again as STEP AP203, AP214 or AP242, or as a mesh";

static PROCESS: OnceLock<StepProcess> = OnceLock::new();

/// A process of its own for the CAD kernel that reads STEP files: what ends it is an error of the
/// reader, not the end of the program.
#[derive(Debug, Clone, PartialEq)]
pub struct StepProcess {
    /// Executable that ends in a call of [`serve_step`].
    pub program: PathBuf,
    /// Its arguments; the limits of memory \[bytes\] and of processor time \[s\] follow them.
    pub arguments: Vec<String>,
    /// Most processor time for one file \[s\].
    pub seconds: u64,
}

impl StepProcess {
    /// From now on all STEP files of this program are read so. Without it they are read in the
    /// program's own process. False when it was already set.
    pub fn install(self) -> bool {
        PROCESS.set(self).is_ok()
    }
}

/// The other side of a [`StepProcess`]: the bytes of a STEP file on `input`, its triangles on
/// `output`, within these limits of memory \[bytes\] and processor time \[s\].
///
/// # Errors
/// When a limit cannot be set or a stream fails. A file that cannot be read is an answer, not an
/// error.
pub fn serve_step(
    memory: u64,
    seconds: u64,
    mut input: impl Read,
    output: impl Write,
) -> std::io::Result<()> {
    #[cfg(unix)]
    {
        use rlimit::Resource;
        // A process may not raise a limit that it was started with.
        let lower = |resource: Resource, soft: u64, hard: u64| {
            let most = resource.get_hard()?;
            resource.set(soft.min(most), hard.min(most))
        };
        lower(Resource::AS, memory, memory)?;
        lower(Resource::CPU, seconds, seconds + 1)?;
        lower(Resource::CORE, 0, 0)?;
    }
    #[cfg(not(unix))]
    let _ = (memory, seconds);
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes)?;
    let mut output = BufWriter::new(output);
    let mut failed = None;
    let answer = tessellate(&bytes, &mut |record| {
        let written = match record {
            // What came before a crash must have left this process.
            Record::Stage(name) => {
                write_text(&mut output, b'S', name).and_then(|()| output.flush())
            }
            Record::Face(kind, numbers) => {
                output.write_all(&[b'P', kind]).and_then(|()| write_numbers(&mut output, &numbers))
            }
            Record::Triangle(corners) => output
                .write_all(b"T")
                .and_then(|()| write_numbers(&mut output, corners.as_flattened())),
        };
        if let Err(error) = written {
            failed.get_or_insert(error);
        }
    });
    if let Some(error) = failed {
        return Err(error);
    }
    match answer {
        Ok(left_out) => {
            output.write_all(b"E")?;
            output.write_all(&left_out.to_le_bytes())?;
        }
        Err(message) => write_text(&mut output, b'F', &message)?,
    }
    output.flush()
}

fn write_text(output: &mut impl Write, mark: u8, text: &str) -> std::io::Result<()> {
    let bytes = &text.as_bytes()[..text.len().min(255)];
    output.write_all(&[mark, bytes.len() as u8])?;
    output.write_all(bytes)
}

fn write_numbers(output: &mut impl Write, numbers: &[f64]) -> std::io::Result<()> {
    numbers.iter().try_for_each(|number| output.write_all(&number.to_le_bytes()))
}

/// What the kernel says on its way.
enum Record<'a> {
    Stage(&'a str),
    /// The triangles of a face follow; its surface as [`Stated::from_kernel`] takes it.
    Face(u8, [f64; 8]),
    Triangle([[f64; 3]; 3]),
}

type Sink<'a> = &'a mut dyn FnMut(Record<'_>);

#[allow(unsafe_code, reason = "the C++ side of this reader; its contract stands in step.cpp")]
unsafe extern "C" {
    fn gripfast_step(
        data: *const c_char,
        size: usize,
        share: c_double,
        most: c_double,
        angle: c_double,
        user: *mut c_void,
        stage: extern "C" fn(*mut c_void, *const c_char),
        face: extern "C" fn(*mut c_void, c_int, *const c_double),
        triangle: extern "C" fn(*mut c_void, *const c_double),
        message: *mut c_char,
        room: usize,
    ) -> c_int;
}

#[allow(
    unsafe_code,
    reason = "called back with the sink and nine numbers that `tessellate` and step.cpp own"
)]
extern "C" fn take(user: *mut c_void, nine: *const c_double) {
    // SAFETY: `user` is the sink that `tessellate` passed, `nine` an array of nine.
    let (sink, nine) = unsafe { (&mut *user.cast::<Sink<'_>>(), &*nine.cast::<[[f64; 3]; 3]>()) };
    sink(Record::Triangle(*nine));
}

#[allow(
    unsafe_code,
    reason = "called back with the sink and eight numbers that `tessellate` and step.cpp own"
)]
extern "C" fn begin(user: *mut c_void, kind: c_int, eight: *const c_double) {
    // SAFETY: `user` is the sink that `tessellate` passed, `eight` an array of eight.
    let (sink, eight) = unsafe { (&mut *user.cast::<Sink<'_>>(), &*eight.cast::<[f64; 8]>()) };
    sink(Record::Face(kind as u8, *eight));
}

#[allow(unsafe_code, reason = "called back with the sink and a name that step.cpp owns")]
extern "C" fn enter(user: *mut c_void, name: *const c_char) {
    // SAFETY: `user` is the sink that `tessellate` passed, `name` a text with its end.
    let (sink, name) = unsafe { (&mut *user.cast::<Sink<'_>>(), CStr::from_ptr(name)) };
    sink(Record::Stage(&name.to_string_lossy()));
}

/// Triangles of a STEP text in millimetres into `sink`; the number of faces left out, or why it
/// cannot be read.
fn tessellate(bytes: &[u8], mut sink: Sink<'_>) -> std::result::Result<i32, String> {
    // The kernel keeps units and other settings of a file in variables of the whole process.
    static KERNEL: Mutex<()> = Mutex::new(());
    let _alone = KERNEL.lock().unwrap_or_else(PoisonError::into_inner);
    let mut message = [0_u8; 256];
    #[allow(
        unsafe_code,
        reason = "pointers and lengths of live buffers; the callbacks get the sink back"
    )]
    // SAFETY: step.cpp reads `bytes` and writes `message` within the lengths given, calls back on
    // this thread only, and keeps nothing.
    let left_out = unsafe {
        gripfast_step(
            bytes.as_ptr().cast(),
            bytes.len(),
            DEFLECTION_SHARE,
            DEFLECTION_MOST,
            DEFLECTION_ANGLE,
            (&raw mut sink).cast(),
            enter,
            begin,
            take,
            message.as_mut_ptr().cast(),
            message.len(),
        )
    };
    if left_out >= 0 {
        return Ok(left_out);
    }
    Err(CStr::from_bytes_until_nul(&message)
        .map_or_else(|_| "unreadable".into(), |text| text.to_string_lossy().into_owned()))
}

/// Reads and tessellates. The kernel converts the file's unit to millimetres.
pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let bytes = source.bytes()?;
    let start = String::from_utf8_lossy(&bytes[..bytes.len().min(256)]);
    if !start.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']).starts_with("ISO-10303-21") {
        return Err(source.bad(
            "is not a STEP file: it does not begin with ISO-10303-21",
            "export the part again",
        ));
    }
    let mut welder = Welder::default();
    let left_out = match PROCESS.get() {
        Some(process) => apart(source, process, &bytes, &mut welder)?,
        None => {
            let mut fault = None;
            let left_out = tessellate(&bytes, &mut |record| match record {
                Record::Face(kind, numbers) => {
                    welder.face(Stated::from_kernel(kind, numbers));
                }
                Record::Triangle(corners) if fault.is_none() => {
                    fault = add(source, &mut welder, corners).err();
                }
                Record::Triangle(_) | Record::Stage(_) => {}
            });
            match fault {
                Some(fault) => return Err(fault),
                None => left_out.map_err(|message| unreadable(source, &message))?,
            }
        }
    };
    let warnings = match left_out {
        0 => Vec::new(),
        1 => vec!["1 face of the STEP file could not be tessellated and is missing".to_string()],
        many => {
            vec![format!("{many} faces of the STEP file could not be tessellated and are missing")]
        }
    };
    Ok(welder.finish(Some(Unit::Millimetre), warnings))
}

fn add(source: &Source<'_>, welder: &mut Welder, corners: [[f64; 3]; 3]) -> Result<()> {
    let mut points = [DVec3::ZERO; 3];
    for (k, (point, corner)) in points.iter_mut().zip(corners).enumerate() {
        *point = source.finite(DVec3::from_array(corner), 3 * welder.count() + k + 1)?;
    }
    welder.triangle(points);
    source.check_count(welder)
}

fn unreadable(source: &Source<'_>, message: &str) -> Error {
    source.bad(format!("cannot be read as STEP: {}", message.escape_debug()), REMEDY)
}

/// Reads in a process of its own; the number of faces left out.
fn apart(
    source: &Source<'_>,
    process: &StepProcess,
    bytes: &[u8],
    welder: &mut Welder,
) -> Result<i32> {
    let cannot = |action: &'static str| {
        move |error: std::io::Error| Error::io(&process.program, action, error)
    };
    let mut child = Command::new(&process.program)
        .args(&process.arguments)
        .args([source.budget.limit().to_string(), process.seconds.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(cannot("start the CAD kernel"))?;
    // A child that has died already shows in its answer.
    let _ = child.stdin.take().map(|mut input| input.write_all(bytes));
    let mut stage = String::from("starting");
    let answer = match child.stdout.take() {
        Some(output) => answer(source, BufReader::new(output), welder, &mut stage),
        None => Ok(None),
    };
    // A child that has said all, or whose answer is refused, is not waited for; one that has gone
    // silent has ended, and how it ended is the answer.
    if !matches!(answer, Ok(None)) {
        let _ = child.kill();
    }
    let status = child.wait().map_err(cannot("wait for the CAD kernel"))?;
    match answer? {
        Some(left_out) => Ok(left_out),
        None => Err(crashed(source, process, &stage, status)),
    }
}

/// Takes what the child sends; the number of faces left out, `None` when the child ended before its
/// last word.
fn answer(
    source: &Source<'_>,
    mut output: impl Read,
    welder: &mut Welder,
    stage: &mut String,
) -> Result<Option<i32>> {
    let mut mark = [0];
    let text = |output: &mut dyn Read| -> std::io::Result<String> {
        let mut length = [0];
        output.read_exact(&mut length)?;
        let mut bytes = vec![0; usize::from(length[0])];
        output.read_exact(&mut bytes)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    while output.read_exact(&mut mark).is_ok() {
        match mark {
            [b'S'] => match text(&mut output) {
                Ok(name) => *stage = name,
                Err(_) => return Ok(None),
            },
            [b'P'] => {
                let (mut kind, mut numbers) = ([0], [0.0; 8]);
                let read = output.read_exact(&mut kind);
                if read.and_then(|()| read_numbers(&mut output, &mut numbers)).is_err() {
                    return Ok(None);
                }
                welder.face(Stated::from_kernel(kind[0], numbers));
            }
            [b'T'] => {
                let mut numbers = [[0.0; 3]; 3];
                if read_numbers(&mut output, numbers.as_flattened_mut()).is_err() {
                    return Ok(None);
                }
                add(source, welder, numbers)?;
            }
            [b'E'] => {
                let mut bytes = [0; 4];
                return Ok(output.read_exact(&mut bytes).ok().map(|()| i32::from_le_bytes(bytes)));
            }
            [b'F'] => match text(&mut output) {
                Ok(message) => return Err(unreadable(source, &message)),
                Err(_) => return Ok(None),
            },
            _ => return Err(unreadable(source, "the CAD kernel's answer is not understood")),
        }
    }
    Ok(None)
}

fn read_numbers(output: &mut impl Read, numbers: &mut [f64]) -> std::io::Result<()> {
    let mut bytes = [0; 8];
    for number in numbers {
        output.read_exact(&mut bytes)?;
        *number = f64::from_le_bytes(bytes);
    }
    Ok(())
}

/// The error of a child that ended before its last word, in this stage.
fn crashed(source: &Source<'_>, process: &StepProcess, stage: &str, status: ExitStatus) -> Error {
    #[cfg(unix)]
    let signal = std::os::unix::process::ExitStatusExt::signal(&status);
    #[cfg(not(unix))]
    let signal: Option<i32> = None;
    /// The processor time is used up.
    const TIME: i32 = 24;
    if signal == Some(TIME) {
        return source
            .bad(
                format!("the CAD kernel took more than {} s while {stage}", process.seconds),
                REMEDY,
            )
            .with_kind(ErrorKind::Limit);
    }
    let how = signal.map_or_else(|| status.to_string(), |signal| format!("signal {signal}"));
    source.bad(format!("the CAD kernel crashed while {stage} ({how})"), REMEDY)
}
