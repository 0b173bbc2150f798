//! Files written whole or not at all.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::error::{Error, Result};

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

#[cfg(unix)]
fn builder() -> tempfile::Builder<'static, 'static> {
    use std::os::unix::fs::PermissionsExt;
    let mut builder = tempfile::Builder::new();
    // As any new file, less the user's mask; the default of temporary files would shut other users
    // out of results.
    builder.prefix(".gripfast-").permissions(std::fs::Permissions::from_mode(0o666));
    builder
}

#[cfg(not(unix))]
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".gripfast-");
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
    fn a_missing_folder_and_a_folder_as_name_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        assert!(write(&folder.path().join("no/such/out.txt"), |_| Ok(())).is_err());
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
