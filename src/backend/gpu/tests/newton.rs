//! Estimates of loads without bounds: against double precision, and the kernel against its twin.

use super::super::newton::estimate;
use super::*;
use crate::backend::cpu::Searched;
use crate::backend::layout::UNBOUNDED;
use crate::backend::prepare::Prepared;
use crate::mechanics::{Options, Search, solve_pads};

/// What came of some loads.
#[derive(Debug, Default)]
struct Count {
    loads: usize,
    separated: usize,
    estimated: usize,
    estimated_separated: usize,
    refused: usize,
    error: f64,
    of_margin: f64,
    margins: Vec<f64>,
}

#[test]
fn estimates_are_within_their_margin() {
    let mut random = Random(101);
    let seeds = SeedSet::default();
    let mut count = Count::default();
    for index in 0..400 {
        let contact = match index % 3 {
            0 => random.contact(true),
            1 => random.contact(false),
            _ => (*random.two_stars()).clone(),
        };
        let contact = Arc::new(contact);
        let prepared = Prepared::new(&contact);
        let (Some(pads), Some(records)) = (&prepared.pads, &prepared.records) else { continue };
        let strength = 40.0 * 10_f64.powf(random.within(-1.5, -0.2));
        let arm = random.within(0.0, 0.03);
        let wrenches: Vec<Wrench> = (0..100)
            .map(|_| Wrench {
                force: random.vector() * strength,
                moment: random.vector() * strength * arm,
            })
            .collect();
        let distance = random.within(0.0, 0.04);
        let problem =
            Problem { contact: &contact, distance, force: 40.0, wrenches: &wrenches, pose: None };
        let searched = Searched::new(records, &seeds);
        let field = searched.field();
        for wrench in &wrenches {
            let Ok((load, _)) = records.load(&problem, wrench) else { continue };
            let mut seed = [SeedRecord::default()];
            field.search(&[load], &mut seed);
            if seed[0].status != UNBOUNDED {
                continue;
            }
            count.loads += 1;
            let options = Options { search: Search::Off, ..Options::default() };
            let score = solve_pads(pads, distance, 40.0, wrench, &options);
            let areas = [&contact.face_i, &contact.face_ii].map(|x| crate::geometry::patch_area(x));
            let lifted = score.contact_area_i < 0.999 * areas[0]
                || score.contact_area_ii < 0.999 * areas[1];
            count.separated += usize::from(lifted && score.mu_s.is_some());
            count.refused += usize::from(score.mu_s.is_none());
            let found = estimate(field.header, &field.edges, &load, 0.0, seed[0].twist);
            if found.lower > found.upper {
                continue;
            }
            count.estimated += 1;
            count.estimated_separated += usize::from(lifted);
            let Some(mu) = score.mu_s else {
                println!("estimated but refused: {found:?} {score:?} {wrench:?}");
                continue;
            };
            let [lower, upper] = [found.lower, found.upper].map(f64::from);
            let (middle, half) = ((lower + upper) / 2.0, (upper - lower) / 2.0);
            let share = (middle - mu).abs() / half;
            count.of_margin = count.of_margin.max(share);
            count.error = count.error.max((middle / mu - 1.0).abs());
            count.margins.push(half / middle);
            if share > 0.3 {
                println!("{share}: {found:?} {mu} {:?}", load);
            }
        }
    }
    count.margins.sort_by(f64::total_cmp);
    let at = |x: f64| count.margins[(x * (count.margins.len() - 1) as f64) as usize];
    println!("margins {:.1e} {:.1e} {:.1e} {:.1e}", at(0.1), at(0.5), at(0.9), at(0.99));
    count.margins.clear();
    println!("{count:?}");
}
