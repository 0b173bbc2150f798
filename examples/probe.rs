use glam::{DVec2, DVec3};
use gripfast::mechanics::*;
use gripfast::model::*;
fn main() {
    let a: Vec<f64> = std::env::args().skip(1).map(|x| x.parse().unwrap()).collect();
    let ring = [(-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01)].map(|(x, y)| DVec2::new(x, y)).to_vec();
    let patch = vec![Polygon { outer: ring, holes: Vec::new() }];
    let c = Contact { face_i: patch.clone(), face_ii: patch };
    let pads = Pads::new(&c).unwrap();
    let n = a[2] as usize;
    let search = if a.len() > 3 { Search::Off } else { Search::WhereNeeded };
    for i in 0..=n {
        let k = a[0] + (a[1] - a[0]) * i as f64 / n as f64;
        let w = Wrench { force: DVec3::new(3.0, -2.0, 1.0) * k, moment: DVec3::new(0.3, -0.2, 0.05) * k };
        let t = std::time::Instant::now();
        let s = solve_pads(&pads, 0.02, 50.0, &w, &Options { search, ..Default::default() });
        println!(
            "{k:.6} {:?} mu {:?} areas {:.3e} {:.3e} res {:.1e} ev {} {:?}",
            s.status,
            s.mu_s,
            s.contact_area_i / 4e-4,
            s.contact_area_ii / 4e-4,
            s.residual,
            s.evaluations,
            t.elapsed()
        );
    }
}
