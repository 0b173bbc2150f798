//! Files written whole or not at all, and read within the memory allowed.

mod guard;

use std::fs::File;
use std::hash::{Hash, Hasher};
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, ErrorKind, Result};
use crate::memory::{self, Budget};
pub(crate) use guard::guarded;

/// Writes a file so that its name never stands for a part of it: the content goes to a temporary
/// file in the same folder, is forced to the disk and takes the name at the end. A failure or a
/// kill on the way leaves an older file as it was.
///
/// Something that is no regular file (a pipe, `/dev/stdout`) is written directly.
///
/// # Errors
/// When the folder cannot be written, the disk is full, or `content` fails.
pub fn write(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<()> {
    let failed = |source| Error::io(path, "write", source);
    if std::fs::metadata(path).is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        let mut writer = BufWriter::new(File::options().write(true).open(path).map_err(failed)?);
        return content(&mut writer).and_then(|()| writer.flush()).map_err(failed);
    }
    folder_of(path, &path.display().to_string())?;
    if path.is_dir() {
        return Err(failed(std::io::ErrorKind::IsADirectory.into()));
    }
    // Through a symbolic link to its file: renaming over the link would cut it.
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let temporary = builder().tempfile_in(folder).map_err(failed)?;
    // While it is held no other run takes it for what was left behind.
    let _ = temporary.as_file().try_lock();
    let mut writer = BufWriter::new(temporary.as_file().try_clone().map_err(failed)?);
    content(&mut writer)
        .and_then(|()| writer.flush())
        .and_then(|()| temporary.as_file().sync_all())
        .map_err(failed)?;
    drop(writer);
    temporary.persist(&target).map_err(|error| failed(error.error))?;
    // The new name is on the disk once its folder is; not every file system allows to ask for this.
    #[cfg(unix)]
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Removes what runs killed within [`write`] have left behind in a folder; files that a run still
/// writes stay.
pub(crate) fn sweep(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let named = entry.file_name().as_encoded_bytes().starts_with(TEMPORARY.as_bytes());
        let file = named.then(|| File::options().write(true).open(entry.path()));
        if let Some(Ok(file)) = file
            && file.try_lock().is_ok()
        {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Makes sure that the folder of a file is there; `place` names the file.
///
/// # Errors
/// [`ErrorKind::NotFound`] when it is not.
pub(crate) fn folder_of(path: &Path, place: &str) -> Result<()> {
    match path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
        None => Ok(()),
        Some(folder) => Err(Error::new(
            ErrorKind::NotFound,
            place,
            format!("the folder '{}' is not there", folder.display()),
            "make it first",
        )),
    }
}

/// Held while a run works on an output: a second run on it is refused. The system frees it when
/// the process ends, however it ends.
#[derive(Debug)]
pub struct Lock {
    _file: Option<File>,
}

impl Lock {
    /// Takes the lock of `output`; of a pipe or device there is none. It lies in the user's folder
    /// of run-time files, or in the one for temporary files, and holds on this machine. What
    /// killed runs have left beside the output is removed.
    ///
    /// # Errors
    /// [`ErrorKind::Busy`] when another process holds it.
    pub fn take(output: &Path) -> Result<Self> {
        if std::fs::metadata(output).is_ok_and(|metadata| !metadata.is_file()) {
            return Ok(Self { _file: None });
        }
        let folder = match output.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let target = std::fs::canonicalize(output).or_else(|_| {
            let name = output.file_name().unwrap_or_default();
            std::fs::canonicalize(folder).map(|folder| folder.join(name))
        });
        let target = target.unwrap_or_else(|_| output.to_path_buf());
        let mut hasher = rustc_hash::FxHasher::default();
        target.hash(&mut hasher);
        let place = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
        let place = place.filter(|place| place.is_dir()).unwrap_or_else(std::env::temp_dir);
        let path = place.join(format!("gripfast-{:016x}.lock", hasher.finish()));
        // Where no lock can be made the run goes on without.
        let file = File::options().create(true).truncate(false).write(true).open(path);
        let Ok(file) = file else { return Ok(Self { _file: None }) };
        match file.try_lock() {
            Err(std::fs::TryLockError::WouldBlock) => Err(Error::new(
                ErrorKind::Busy,
                output.display().to_string(),
                "another run is writing it",
                "wait for that run, or name another file",
            )
            .with_options(&["output"])),
            _ => {
                sweep(folder);
                Ok(Self { _file: Some(file) })
            }
        }
    }
}

/// Share of the memory that a text may take by default: what is made of it takes a few times as
/// much.
const TEXT_SHARE: u64 = 8;

/// The bytes of a file, at most an eighth of [`memory::default_limit`]; no device or folder, but a
/// pipe.
///
/// # Errors
/// When it cannot be read, is a device or folder, or is larger.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let failed = |source| Error::io(path, "read", source);
    let meta = std::fs::metadata(path).map_err(failed)?;
    if meta.is_dir() {
        return Err(failed(std::io::ErrorKind::IsADirectory.into()));
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if meta.file_type().is_char_device() && !is_standard_input(path) {
            let place = path.display().to_string();
            return Err(Error::format(place, "is a device, not a file", "name a file"));
        }
    }
    read_from(File::open(path).map_err(failed)?, path)
}

/// [`read`] from an open stream that `path` names.
///
/// # Errors
/// When it cannot be read or is larger.
pub fn read_from(stream: impl Read, path: &Path) -> Result<Vec<u8>> {
    let budget = Budget::new(Some(memory::default_limit() / TEXT_SHARE));
    let mut bytes = Vec::new();
    stream
        .take(budget.limit() + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| Error::io(path, "read", source))?;
    budget.hold(&path.display().to_string(), bytes.len() as u64)?;
    Ok(bytes)
}

/// [`read`] as text.
///
/// # Errors
/// As [`read`], and when it is no UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    text(read(path)?, path)
}

/// `bytes` of `path` as text.
///
/// # Errors
/// When they are no UTF-8; the message names the line.
pub fn text(bytes: Vec<u8>, path: &Path) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = valid.iter().filter(|&&byte| byte == b'\n').count() + 1;
        Error::format(
            format!("{}:{line}", path.display()),
            "is not a text in UTF-8",
            "save the file as UTF-8 text",
        )
    })
}

/// How the names of temporary files begin.
const TEMPORARY: &str = ".gripfast-";

/// Standard input by its name, which a terminal may be behind.
#[cfg(unix)]
fn is_standard_input(path: &Path) -> bool {
    path == Path::new("/dev/stdin") || path.starts_with("/dev/fd") || path.starts_with("/proc/self")
}

#[cfg(unix)]
fn builder() -> tempfile::Builder<'static, 'static> {
    use std::os::unix::fs::PermissionsExt;
    let mut builder = tempfile::Builder::new();
    // As any new file, less the user's mask; the default of temporary files would shut other users
    // out of results.
    builder.prefix(TEMPORARY).permissions(std::fs::Permissions::from_mode(0o666));
    builder
}

#[cfg(not(unix))]
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY);
    builder
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.txt");
        write(&path, |writer| writer.write_all(b"old")).unwrap();
        let error = write(&path, |writer| {
            writer.write_all(b"half of the n")?;
            Err(std::io::Error::other("broken"))
        });
        assert!(error.unwrap_err().to_string().contains("out.txt"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write(&path, |writer| writer.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn an_output_is_held_by_one_run() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.json");
        let held = Lock::take(&path).unwrap();
        let same = folder.path().join(".").join("out.json");
        assert_eq!(Lock::take(&same).unwrap_err().kind(), ErrorKind::Busy);
        Lock::take(&folder.path().join("other.json")).unwrap();
        drop(held);
        Lock::take(&path).unwrap();
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_what_is_being_written_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.txt");
        std::fs::write(folder.path().join(".gripfast-AbC123"), b"half").unwrap();
        std::fs::write(folder.path().join(".gripfast.toml"), b"the user's").unwrap();
        let names = || {
            let entries = std::fs::read_dir(folder.path()).unwrap();
            let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        write(&path, |writer| {
            // Another run begins in the same folder.
            let _held = Lock::take(&folder.path().join("other.txt")).unwrap();
            assert_eq!(names().len(), 2, "{:?}", names());
            writer.write_all(b"new")
        })
        .unwrap();
        assert_eq!(names(), [".gripfast.toml", "out.txt"]);
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn what_is_no_text_or_no_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in.txt");
        std::fs::write(&path, b"one\ntwo \xff").unwrap();
        assert_eq!(read(&path).unwrap().len(), 9);
        assert!(read_text(&path).unwrap_err().to_string().contains("in.txt:2"));
        assert!(read(folder.path()).is_err());
        #[cfg(unix)]
        assert!(read(Path::new("/dev/zero")).unwrap_err().to_string().contains("device"));
    }

    #[test]
    fn a_missing_folder_and_a_folder_as_name_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let error = write(&folder.path().join("no/such/out.txt"), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("no/such' is not there"), "{error}");
        assert!(write(folder.path(), |_| Ok(())).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_others_may_read() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("out.txt"), folder.path().join("link"));
        std::os::unix::fs::symlink(&path, &link).unwrap();
        std::fs::write(&path, b"old").unwrap();
        write(&link, |writer| writer.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert!(link.is_symlink());
        assert_ne!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o600, 0);
    }
}
