//! GraspNet's rows in a NumPy archive: score, width, height, depth, rotation (9), translation (3),
//! object id.
//!
//! The score is the smallest friction coefficient that holds, as in GraspNet's labels: the smaller,
//! the better. (GraspNet's API turns labels into `1.1 - friction` when it loads them; the array
//! `api_scores` holds that.)

use std::io::{Cursor, Seek, Write};

use zip::write::SimpleFileOptions;

use super::View;

/// Columns of a row.
const COLUMNS: usize = 17;
/// What GraspNet writes for an object that has no number.
const NO_OBJECT: f64 = -1.0;
/// What GraspNet writes for a grasp that no friction holds.
const NOT_HELD: f64 = -1.0;

pub(super) fn write(view: &View<'_>, writer: &mut impl Write) -> std::io::Result<()> {
    let pad = view.gripper.as_ref().map(|gripper| gripper.pad.as_slice()).unwrap_or_default();
    let bounds = crate::geometry::Bounds2::of(pad);
    let (height, depth) =
        if bounds.is_empty() { (0.0, 0.0) } else { (bounds.size().y, bounds.max.x) };
    let grips = view.grips();
    let mut rows = Vec::with_capacity(grips.len() * COLUMNS);
    let mut scores = Vec::with_capacity(grips.len());
    for grip in grips {
        let pose = view.pose(grip);
        let score = grip.worst.mu_s.unwrap_or(NOT_HELD);
        scores.push(score);
        rows.extend([score, view.gap(grip), height, depth]);
        // Row by row, as NumPy's reshape(3, 3) reads them.
        rows.extend(pose.rotation.transpose().to_cols_array());
        rows.extend(pose.origin.to_array());
        rows.push(NO_OBJECT);
    }
    let api_scores: Vec<f64> =
        scores.iter().map(|score| if *score == NOT_HELD { 0.0 } else { 1.1 - score }).collect();
    let ids: Vec<u64> = grips.iter().map(|grip| grip.grip.id).collect();

    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    array(
        &mut archive,
        "grasps",
        "<f8",
        &[grips.len(), COLUMNS],
        rows.iter().map(|value| value.to_le_bytes()),
    )?;
    array(
        &mut archive,
        "scores",
        "<f8",
        &[grips.len()],
        scores.iter().map(|value| value.to_le_bytes()),
    )?;
    array(
        &mut archive,
        "api_scores",
        "<f8",
        &[grips.len()],
        api_scores.iter().map(|value| value.to_le_bytes()),
    )?;
    array(&mut archive, "ids", "<u8", &[grips.len()], ids.iter().map(|value| value.to_le_bytes()))?;
    let poses: Vec<f64> = grips
        .iter()
        .flat_map(|grip| super::matrix(&view.pose(grip)).into_iter().flatten())
        .collect();
    let poses = poses.iter().map(|value| value.to_le_bytes());
    array(&mut archive, "poses", "<f8", &[grips.len(), 4, 4], poses)?;
    for (name, value) in [
        ("part_file", view.set.part.file.as_str()),
        ("gripper_name", view.name()),
        ("tool_frame", &view.tool_frame()),
    ] {
        text(&mut archive, name, value)?;
    }
    writer.write_all(archive.finish().map_err(std::io::Error::other)?.get_ref())
}

/// A text without dimensions: NumPy holds it as characters of four bytes.
fn text<W: Write + Seek>(
    archive: &mut zip::ZipWriter<W>,
    name: &str,
    value: &str,
) -> std::io::Result<()> {
    // NumPy has no text of length zero.
    let value = if value.is_empty() { " " } else { value };
    let kind = format!("<U{}", value.chars().count());
    array(archive, name, &kind, &[], value.chars().map(|sign| u32::from(sign).to_le_bytes()))
}

/// One member of the archive in NumPy's format 1.0: magic, version, header length, a Python
/// dictionary padded to 64 bytes, the data.
fn array<W: Write + Seek>(
    archive: &mut zip::ZipWriter<W>,
    name: &str,
    kind: &str,
    shape: &[usize],
    data: impl Iterator<Item = impl AsRef<[u8]>>,
) -> std::io::Result<()> {
    let options = SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Stored)
        .large_file(true);
    archive.start_file(format!("{name}.npy"), options).map_err(std::io::Error::other)?;
    let shape = shape.iter().map(|length| format!("{length},")).collect::<String>();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    const FIXED: usize = 10;
    header.push_str(&" ".repeat((64 - (FIXED + header.len() + 1) % 64) % 64));
    header.push('\n');
    archive.write_all(b"\x93NUMPY\x01\x00")?;
    archive
        .write_all(&u16::try_from(header.len()).map_err(std::io::Error::other)?.to_le_bytes())?;
    archive.write_all(header.as_bytes())?;
    for value in data {
        archive.write_all(value.as_ref())?;
    }
    Ok(())
}
