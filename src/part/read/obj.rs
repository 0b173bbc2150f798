//! OBJ, by `tobj`.

use std::io::{BufRead, Read};

use glam::DVec3;

use super::Source;
use crate::error::Result;
use crate::part::weld::{Soup, Welder};

pub(super) fn read(source: &mut Source<'_>) -> Result<Soup> {
    let options =
        tobj::LoadOptions { triangulate: false, single_index: false, ..Default::default() };
    let mut lines = CountLines { inner: &mut source.reader, lines: 0 };
    // Materials say nothing about the shape: every material file is taken as empty.
    let loaded = tobj::load_obj_buf(&mut lines, &options, |_| Ok(Default::default()));
    let line = lines.lines;
    let (models, _) = loaded.map_err(|fault| {
        source.bad_at(
            format!("line {line}"),
            format!("not a readable OBJ file: {fault}"),
            "repair the line or export the part again",
        )
    })?;
    let mut welder = Welder::default();
    let mut vertices = Vec::new();
    let (mut vertex, mut face) = (0, 0);
    // The library gives 32-bit coordinates.
    let held =
        models.iter().map(|model| 4 * (model.mesh.positions.len() + model.mesh.indices.len()));
    source.hold(held.sum::<usize>() as u64)?;
    for model in models {
        let mesh = model.mesh;
        vertices.clear();
        for position in mesh.positions.chunks_exact(3) {
            vertex += 1;
            let position =
                DVec3::new(f64::from(position[0]), f64::from(position[1]), f64::from(position[2]));
            vertices.push(source.finite(position, vertex)?);
        }
        let mut rest = mesh.indices.as_slice();
        let mut arities = mesh.face_arities.iter();
        while !rest.is_empty() {
            // A mesh of triangles only comes without arities.
            let arity = arities.next().map_or(3, |&arity| arity as usize).clamp(1, rest.len());
            let (corners, tail) = rest.split_at(arity);
            face += 1;
            source.polygon(&mut welder, &vertices, corners, face)?;
            rest = tail;
        }
    }
    Ok(welder.finish(None, Vec::new()))
}

/// Counts the lines that the library has taken, for its errors name none.
struct CountLines<'a, R> {
    inner: &'a mut R,
    lines: usize,
}

impl<R: BufRead> Read for CountLines<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for CountLines<'_, R> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        self.inner.fill_buf()
    }

    fn consume(&mut self, amount: usize) {
        if let Ok(buffer) = self.inner.fill_buf() {
            self.lines += buffer.iter().take(amount).filter(|&&byte| byte == b'\n').count();
        }
        self.inner.consume(amount);
    }
}
