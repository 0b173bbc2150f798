//! Scores contacts of one's own: no part and no gripper, only the areas in touch and what pulls.
//!
//! `cargo run --release --example own_contacts`

use std::sync::Arc;

use glam::{DVec2, DVec3};
use gripfast::backend::{Backend, Batch, Problem, ScoreOptions, SeedSet};
use gripfast::error::Result;
use gripfast::mechanics::{self, Options};
use gripfast::model::{Contact, Polygon, Wrench};

/// A square of this half side about a point of the pad plane [m].
fn square(middle: DVec2, half: f64) -> Polygon {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let outer = corners.map(|(x, y)| middle + half * DVec2::new(x, y)).to_vec();
    Polygon { outer, holes: Vec::new() }
}

fn main() -> Result<()> {
    // One pad of 20 mm lies wholly on the part, of the other only two corners do.
    let contact = Arc::new(Contact {
        face_i: vec![square(DVec2::ZERO, 0.01)],
        face_ii: vec![square(DVec2::splat(-0.007), 0.003), square(DVec2::splat(0.007), 0.003)],
    });
    let (distance, force) = (0.02, 50.0); // between the faces [m], and of the jaws [N]
    let pull = |x: f64, y: f64, turn: f64| Wrench {
        force: DVec3::new(x, y, 0.0),
        moment: DVec3::new(0.0, 0.0, turn),
    };
    let wrenches = [pull(0.0, -5.0, 0.0), pull(0.0, -5.0, 0.05), pull(3.0, 0.0, -0.1)];

    // One contact under one load, with everything that is known of the answer.
    let score = mechanics::solve(&contact, distance, force, &wrenches[1], &Options::default())?;
    println!("{:?}, mu_s {:?}, {:?}", score.status, score.mu_s, score.slip);

    // Many grips under many loads: which is the worst of each, and what friction it needs.
    let problem = Problem { contact: &contact, distance, force, wrenches: &wrenches, pose: None };
    let wider = Problem { distance: 0.06, ..problem };
    let batch = Batch { problems: vec![problem, wider] };
    let scored = Backend::Cpu.score(&batch, &SeedSet::default(), &ScoreOptions::default())?;
    for (index, grip) in scored.iter().enumerate() {
        if let Some((load, score)) = &grip.worst {
            println!("grip {index}: worst load {load}, mu_s {:?}", score.mu_s);
        }
    }
    Ok(())
}
