//! A file of JSON Lines that only grows, each line with its checksum.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use flate2::Crc;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{Error, Result};

/// What stands before the checksum at the end of a line.
const MARK: &str = ",\"crc32\":\"";

/// A ledger, open at its end.
#[derive(Debug)]
pub(super) struct Ledger {
    path: PathBuf,
    file: File,
}

impl Ledger {
    /// Opens one, which may be new, calls `take` with every line that is whole, and returns the number of those that
    /// are not: the last one of a run that was killed, or lines that were damaged. They are taken
    /// out.
    pub(super) fn open<T: DeserializeOwned>(
        path: PathBuf,
        mut take: impl FnMut(T),
    ) -> Result<(Self, usize)> {
        let failed = |error| Error::io(&path, "read", error);
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)?;
        let (mut good, mut bad) = (0_u64, 0);
        let mut rest = Vec::new();
        let mut reader = BufReader::new(&file);
        let mut line = Vec::new();
        loop {
            line.clear();
            if reader.read_until(b'\n', &mut line).map_err(failed)? == 0 {
                break;
            }
            match verified(&line).and_then(|text| serde_json::from_slice(text).ok()) {
                Some(entry) => {
                    take(entry);
                    if bad == 0 {
                        good += line.len() as u64;
                    } else {
                        rest.extend_from_slice(&line);
                    }
                }
                None => bad += 1,
            }
        }
        if bad > 0 && rest.is_empty() {
            file.set_len(good).map_err(failed)?;
        } else if bad > 0 {
            // Whole lines after a damaged one: the file is written again without it.
            let mut start = vec![0; good as usize];
            file.rewind().map_err(failed)?;
            std::io::Read::read_exact(&mut file, &mut start).map_err(failed)?;
            crate::file::write(&path, |writer| {
                writer.write_all(&start)?;
                writer.write_all(&rest)
            })?;
            file = OpenOptions::new().read(true).write(true).open(&path).map_err(failed)?;
        }
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        Ok((Self { path, file }, bad))
    }

    /// Adds a line and forces it to the disk.
    pub(super) fn append(&mut self, entry: &impl Serialize) -> Result<()> {
        let failed = |error| Error::io(&self.path, "write", error);
        let text = serde_json::to_vec(entry).map_err(|error| failed(error.into()))?;
        let mut line = text[..text.len() - 1].to_vec();
        line.extend_from_slice(format!("{MARK}{:08x}\"}}\n", checksum(&text)).as_bytes());
        self.file.write_all(&line).and_then(|()| self.file.sync_data()).map_err(failed)
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

/// The object of a line without its checksum, where that is right.
fn verified(line: &[u8]) -> Option<&[u8]> {
    let end = line.len().checked_sub(MARK.len() + "00000000\"}\n".len())?;
    let stated = line[end..].strip_prefix(MARK.as_bytes())?.strip_suffix(b"\"}\n")?;
    let stated = u32::from_str_radix(std::str::from_utf8(stated).ok()?, 16).ok()?;
    let mut sum = Crc::new();
    sum.update(&line[..end]);
    sum.update(b"}");
    // The checksum is a member of the object like any other for those who read the line.
    (sum.sum() == stated).then(|| &line[..line.len() - 1])
}

/// CRC-32 of bytes.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    let mut sum = Crc::new();
    sum.update(bytes);
    sum.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn lines(path: &Path) -> (Vec<u64>, usize) {
        let mut found = Vec::new();
        let take = |value: Value| found.push(value["n"].as_u64().unwrap());
        let (_, bad) = Ledger::open(path.to_owned(), take).unwrap();
        (found, bad)
    }

    #[test]
    fn a_line_that_is_cut_or_changed_is_taken_out_and_the_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines.jsonl");
        let (mut ledger, _) = Ledger::open(path.clone(), |_: Value| ()).unwrap();
        for n in 0..5 {
            ledger.append(&json!({"n": n, "text": "a \"quoted\" text\n"})).unwrap();
        }
        let whole = std::fs::read(&path).unwrap();
        assert_eq!(lines(&path), (vec![0, 1, 2, 3, 4], 0));
        // Every line is JSON to others.
        for line in whole.split(|&byte| byte == b'\n').filter(|line| !line.is_empty()) {
            let value: Value = serde_json::from_slice(line).unwrap();
            assert_eq!(value["crc32"].as_str().unwrap().len(), 8);
        }
        let fourth = whole.iter().enumerate().filter(|(_, byte)| **byte == b'\n').nth(3).unwrap().0;
        for cut in [1, 5, whole.len() - fourth - 1] {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let expected = usize::from(cut < whole.len() - fourth - 1);
            assert_eq!(lines(&path), (vec![0, 1, 2, 3], expected), "cut by {cut}");
            assert_eq!(lines(&path), (vec![0, 1, 2, 3], 0), "the torn line is gone");
            assert_eq!(std::fs::read(&path).unwrap(), whole[..=fourth]);
        }
        let mut damaged = whole.clone();
        let at = whole.iter().position(|&byte| byte == b'\n').unwrap() + 8;
        damaged[at] ^= 1;
        std::fs::write(&path, &damaged).unwrap();
        assert_eq!(lines(&path), (vec![0, 2, 3, 4], 1));
        assert_eq!(lines(&path), (vec![0, 2, 3, 4], 0));
        // It grows at its end.
        let (mut ledger, _) = Ledger::open(path.clone(), |_: Value| ()).unwrap();
        ledger.append(&json!({"n": 9})).unwrap();
        assert_eq!(lines(&path), (vec![0, 2, 3, 4, 9], 0));
    }
}
