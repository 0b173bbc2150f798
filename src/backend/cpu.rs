//! The kernels on the processor: contacts in parallel, loads in lanes. Answers depend neither on
//! the number of threads nor on the instruction set.

use rayon::prelude::*;

use super::lanes::LANES;
use super::layout::{GroupRecord, LoadRecord, SeedRecord};
use super::prepare::Chunk;
use super::search::Field;
use super::seeds::SeedSet;
use super::table::Table;
use crate::contact::widest;

/// Loads that one task searches at least.
const TASK: usize = 1 << 10;

/// Seeds of every load of the chunk, in its order.
pub(crate) fn run(chunk: &Chunk, seeds: &SeedSet) -> Vec<SeedRecord> {
    let mut records = vec![SeedRecord::default(); chunk.loads.len()];
    // Groups are in the order of contacts: cut them, and the records, contact by contact.
    let mut jobs = Vec::with_capacity(chunk.contacts.len());
    let (mut groups, mut loads, mut rest) =
        (chunk.groups.as_slice(), chunk.loads.as_slice(), records.as_mut_slice());
    for (index, header) in chunk.contacts.iter().enumerate() {
        let (mine, others) =
            groups.split_at(groups.partition_point(|group| group.contact as usize <= index));
        let count = mine.iter().map(|group: &GroupRecord| group.count as usize).sum();
        let (own, later) = loads.split_at(count);
        let (out, remaining) = rest.split_at_mut(count);
        (groups, loads, rest) = (others, later, remaining);
        jobs.push((header, own, out));
    }
    jobs.into_par_iter().for_each(|(header, loads, out)| {
        let face = |first: u32, end: u32| &chunk.edges[first as usize..end as usize];
        let edges =
            [face(header.edges_i, header.edges_ii), face(header.edges_ii, header.edges_end)];
        let table = Table::new(header, edges, seeds);
        let field = Field { header, edges, table: &table, rings: seeds.rings() };
        loads
            .par_chunks(TASK)
            .zip(out.par_chunks_mut(TASK))
            .for_each(|(loads, out)| search(&field, loads, out));
    });
    records
}

widest! {
    /// Searches; both ways to compile it do the same operations in the same order.
    pub(super) fn search(field: &Field<'_>, loads: &[LoadRecord], out: &mut [SeedRecord]) -> () = search_all
}

#[inline(always)]
fn search_all(field: &Field<'_>, loads: &[LoadRecord], out: &mut [SeedRecord]) {
    for (loads, out) in loads.chunks(LANES).zip(out.chunks_mut(LANES)) {
        field.search(loads, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::Problem;
    use crate::backend::layout::{BOUNDED, COUPLED};
    use crate::backend::prepare::Prepared;
    use crate::model::{Contact, Polygon, Wrench};
    use glam::{DVec2, DVec3};
    use std::sync::Arc;

    /// The vector widths give the same bytes, for congruent and for different faces and a number of
    /// loads that fills no vector.
    #[test]
    fn every_instruction_set_gives_the_same_bytes() {
        let rectangle = |a: f64, b: f64, x: f64| {
            let corners = [(-a, -b), (a, -b), (a, b), (-a, b)];
            vec![Polygon {
                outer: corners.map(|(u, v)| DVec2::new(x + u, v)).to_vec(),
                holes: Vec::new(),
            }]
        };
        let wrenches: Vec<Wrench> = (0..77)
            .map(|i| {
                let angle = f64::from(i) * 0.37;
                Wrench {
                    force: DVec3::new(angle.cos(), angle.sin(), 0.3),
                    moment: DVec3::new(0.002, -0.001, 0.01 * (2.0 * angle).sin()),
                }
            })
            .collect();
        let seeds = SeedSet::default();
        for (shift, status) in [(0.0, BOUNDED), (0.001, COUPLED)] {
            let contact = Arc::new(Contact {
                face_i: rectangle(0.01, 0.008, 0.0),
                face_ii: rectangle(0.01 - shift, 0.008, -shift),
            });
            let problem = Problem {
                contact: &contact,
                distance: 0.02,
                force: 40.0,
                wrenches: &wrenches,
                pose: None,
            };
            let prepared = Prepared::new(&contact).records.unwrap();
            let loads: Vec<LoadRecord> =
                wrenches.iter().map(|wrench| prepared.load(&problem, wrench).unwrap().0).collect();
            let (i, ii) = prepared.edges.split_at(prepared.header.edges_ii as usize);
            let table = Table::new(&prepared.header, [i, ii], &seeds);
            let field = Field {
                header: &prepared.header,
                edges: [i, ii],
                table: &table,
                rings: seeds.rings(),
            };
            let (mut narrow, mut wide) = (
                vec![SeedRecord::default(); loads.len()],
                vec![SeedRecord::default(); loads.len()],
            );
            search_all(&field, &loads, &mut narrow);
            search(&field, &loads, &mut wide);
            assert_eq!(
                bytemuck::cast_slice::<SeedRecord, u8>(&narrow),
                bytemuck::cast_slice::<SeedRecord, u8>(&wide)
            );
            assert!(narrow.iter().all(|record| record.status == status), "{narrow:?}");
        }
    }
}
