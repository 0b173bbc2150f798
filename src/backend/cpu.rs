//! The search on the processor: loads in lanes. Answers depend neither on the number of threads nor
//! on the instruction set.

use super::lanes::LANES;
use super::layout::{LoadRecord, SeedRecord};
use super::prepare::{Records, not_searched};
use super::problem::{Problem, Seed, SeedStatus, check_load};
use super::search::Field;
use super::seeds::SeedSet;
use super::table::Table;
use crate::contact::widest;
use crate::error::Result;

/// Loads of one problem, rising, with their seeds.
pub(super) type Found = Vec<(u32, Seed)>;

/// A contact on which loads are searched.
pub(super) struct Searched<'a> {
    pub(super) records: &'a Records,
    pub(super) seeds: &'a SeedSet,
    pub(super) table: Table<'a>,
}

impl<'a> Searched<'a> {
    pub(super) fn new(records: &'a Records, seeds: &'a SeedSet) -> Self {
        let table = Table::new(&records.header, records.faces(), seeds);
        Self { records, seeds, table }
    }

    pub(super) fn field(&self) -> Field<'_> {
        Field {
            header: &self.records.header,
            edges: self.records.faces(),
            table: &self.table,
            rings: self.seeds.rings(),
        }
    }

    /// Some loads of the problem with this `index`, with their seeds.
    ///
    /// # Errors
    /// A bad value for a load that is not finite.
    pub(super) fn found(
        &self,
        problem: &Problem<'_>,
        index: usize,
        loads: impl Iterator<Item = usize>,
    ) -> Result<Found> {
        let mut found = Found::new();
        let mut searched: Vec<(usize, f64)> = Vec::new();
        let mut records: Vec<LoadRecord> = Vec::new();
        for load in loads {
            let wrench = &problem.wrench(load);
            check_load((load, wrench), index)?;
            let seed = match self.records.load(problem, wrench) {
                Ok((record, scale)) => {
                    searched.push((found.len(), scale));
                    records.push(record);
                    not_searched(SeedStatus::NoContact)
                }
                Err(status) => not_searched(status),
            };
            found.push((load as u32, seed));
        }
        let mut answers = vec![SeedRecord::default(); records.len()];
        search(&self.field(), &records, &mut answers);
        for ((place, scale), record) in searched.into_iter().zip(&answers) {
            found[place].1 = self.records.answer(record, scale)?;
        }
        Ok(found)
    }
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
