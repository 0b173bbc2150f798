#[path = "../tests/brute/mod.rs"]
mod brute;
use gripfast::mechanics::*;
fn main() {
    let a: Vec<u64> = std::env::args().skip(1).map(|x| x.parse().unwrap()).collect();
    let mut n = std::collections::BTreeMap::new();
    let t = std::time::Instant::now();
    for i in a[0]..a[0] + a[1] {
        let c = brute::cases::case(i);
        let s = solve(&c.contact, c.distance, c.force, &c.wrench, &Options::default()).unwrap();
        *n.entry(format!("{:?}", s.status)).or_insert(0) += 1;
        if format!("{:?}", s.status) == "NotConverged" {
            println!("{i} d {} F {:?}", c.distance, c.wrench.force);
        }
    }
    println!("{n:?} {:?}", t.elapsed());
}
