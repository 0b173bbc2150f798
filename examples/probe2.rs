#[path = "../tests/brute/mod.rs"]
mod brute;
use gripfast::mechanics::*;
fn main() {
    for a in std::env::args().skip(1) {
        let n: u64 = a.parse().unwrap();
        let c = brute::cases::case(n);
        let t = std::time::Instant::now();
        let s = solve(&c.contact, c.distance, c.force, &c.wrench, &Options::default()).unwrap();
        println!(
            "case {n}: d {} F {:?} M {:?} {:?} mu {:?} areas {:.3e} {:.3e} ev {} {:?}",
            c.distance,
            c.wrench.force,
            c.wrench.moment,
            s.status,
            s.mu_s,
            s.contact_area_i,
            s.contact_area_ii,
            s.evaluations,
            t.elapsed()
        );
        println!("   check unit {:?}", brute::check(&c, &s));
        let (length, force) = brute::cases::Case::units(n);
        let posed = c.scaled(length, force);
        let s2 = solve(&posed.contact, posed.distance, posed.force, &posed.wrench, &Options::default()).unwrap();
        println!("   check posed {length} {force} {:?} own {}", brute::check(&posed, &s2), s2.residual);
        let all = limit_states(&c.contact, c.distance, c.force, &c.wrench, &Options::default()).unwrap();
        for s in &all {
            println!("   state {:?} mu {:?} areas {:.3e} {:.3e} res {:.1e}", s.status, s.mu_s, s.contact_area_i, s.contact_area_ii, s.residual);
        }
        let p = brute::Problem::new(&c).unwrap();
        let scan = p.scan(48, 24);
        println!("   scan winding {:?} zeros {:?}", scan.winding, scan.zeros.iter().map(|z| (z.mu, z.x)).collect::<Vec<_>>());
        println!("   branch {:?}", p.branch(400).map(|b| b.mu));
    }
}
