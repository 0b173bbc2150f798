//! The rows of some jobs: JSON Lines, and Parquet where that is built in.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::ledger::checksum;
use crate::error::{Error, Result};
use crate::export::{self, Table};
use crate::model::Negative;
use crate::rank;
use crate::results::{GripSet, RankedGrip};

/// A file of a shard as it was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Written {
    /// Under the folder of the batch, with slashes.
    file: String,
    bytes: u64,
    checksum: u32,
}

impl Written {
    /// Whether the file is there as it was written.
    pub(super) fn is_there(&self, folder: &Path) -> bool {
        std::fs::read(folder.join(&self.file)).is_ok_and(|content| {
            (content.len() as u64, checksum(&content)) == (self.bytes, self.checksum)
        })
    }
}

/// What names the job of a row.
#[derive(Clone, Serialize)]
struct Names<'a> {
    part: &'a str,
    gripper: &'a str,
    loads: &'a str,
}

#[derive(Serialize)]
struct GripRow<'a> {
    #[serde(flatten)]
    names: Names<'a>,
    /// Id of the first grip that a symmetry of the part maps to this one.
    family: u64,
    load_name: &'a str,
    #[serde(flatten)]
    grip: &'a RankedGrip,
}

#[derive(Serialize)]
struct NegativeRow<'a> {
    #[serde(flatten)]
    names: Names<'a>,
    #[serde(flatten)]
    negative: &'a Negative,
}

/// The rows of a shard, job by job.
pub(super) struct Rows {
    grips: Vec<u8>,
    negatives: Option<Vec<u8>>,
    grip_table: Table,
    negative_table: Table,
}

impl Rows {
    pub(super) fn new(negatives: bool) -> Self {
        Self {
            grips: Vec::new(),
            negatives: negatives.then(Vec::new),
            grip_table: Table::default(),
            negative_table: Table::default(),
        }
    }

    /// Adds those of a job, from its entry and its result.
    pub(super) fn add(&mut self, names: [&str; 3], place: &str, content: &[u8]) -> Result<()> {
        let set = GripSet::parse(place, content)?;
        let [part, gripper, loads] = names;
        let names = Names { part, gripper, loads };
        let families = rank::families(&set);
        let failed = |error: serde_json::Error| {
            Error::io(Path::new(place), "write the rows of", std::io::Error::other(error))
        };
        for (grip, &family) in set.grips.iter().zip(&families) {
            let load = set.loads.get(grip.worst.load as usize);
            let load_name = load.map_or("", |load| load.name.as_str());
            let row = GripRow { names: names.clone(), family, load_name, grip };
            serde_json::to_writer(&mut self.grips, &row).map_err(failed)?;
            self.grips.push(b'\n');
        }
        if let Some(lines) = &mut self.negatives {
            for negative in &set.negatives {
                let row = NegativeRow { names: names.clone(), negative };
                serde_json::to_writer(&mut *lines, &row).map_err(failed)?;
                lines.push(b'\n');
            }
        }
        let options = export::Options::default();
        // The gripper is the name of the folder.
        let named = |table: Table| {
            table.without("gripper").with_text("loads", loads).with_text("part", part)
        };
        let grips = export::table(&set, &options)?.with_integers("family", families);
        self.grip_table.append(named(grips));
        self.negative_table.append(named(export::negatives_table(&set, &options)?));
        Ok(())
    }

    /// Writes the files, each whole or not at all.
    pub(super) fn write(
        self,
        folder: &Path,
        gripper: &str,
        number: usize,
        parquet: bool,
    ) -> Result<Vec<Written>> {
        let mut files = vec![("grips.jsonl", "jsonl", self.grips)];
        if let Some(negatives) = self.negatives {
            if parquet && !self.negative_table.columns.is_empty() {
                let table = export::parquet_file(&self.negative_table)?;
                files.push(("negatives.parquet", "parquet", table));
            }
            files.push(("negatives.jsonl", "jsonl", negatives));
        }
        // Without any job that ran there are no columns.
        if parquet && !self.grip_table.columns.is_empty() {
            files.push(("grips.parquet", "parquet", export::parquet_file(&self.grip_table)?));
        }
        let written = files.into_iter().map(|(set, ending, content)| {
            let file = format!("{set}/gripper={}/{number:05}.{ending}", partition(gripper));
            let path = folder.join(&file);
            if let Some(parent) = path.parent() {
                std::fs::create_dir_all(parent)
                    .map_err(|error| Error::io(parent, "make the folder", error))?;
            }
            crate::file::write(&path, |writer| writer.write_all(&content))?;
            Ok(Written { file, bytes: content.len() as u64, checksum: checksum(&content) })
        });
        written.collect()
    }
}

/// Removes what runs killed within [`Rows::write`] have left in the folder of a batch.
pub(super) fn sweep(folder: &Path) {
    for set in ["grips.jsonl", "grips.parquet", "negatives.jsonl", "negatives.parquet"] {
        for partition in std::fs::read_dir(folder.join(set)).into_iter().flatten().flatten() {
            crate::file::sweep(&partition.path());
        }
    }
}

/// A name as the folder of a partition has it: readers undo percent signs.
fn partition(name: &str) -> String {
    let mut text = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-_. ".contains(&byte) {
            text.push(char::from(byte));
        } else {
            text += &format!("%{byte:02X}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_partition_is_one_folder() {
        assert_eq!(partition("robotiq-2f85"), "robotiq-2f85");
        assert_eq!(partition("a/../b=c\u{e4}"), "a%2F..%2Fb%3Dc%C3%A4");
    }
}
