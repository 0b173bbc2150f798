// The logarithm of an edge: twin of the function of that name in src/backend/fan.rs; there is said what it computes.

fn edge_log(h: f32, l: f32, s1: f32, s2: f32, r1: f32, r2: f32) -> f32 {
    if s1 < 0.0 && s2 > 0.0 {
        return log(((s2 + r2) / h) * ((r1 - s1) / h));
    }
    let z = l / (r1 + r2);
    if z > SERIES_LIMIT {
        if s1 >= 0.0 {
            return log((s2 + r2) / (s1 + r1));
        }
        return log((r1 - s1) / (r2 - s2));
    }
    let q = z * z;
    return 2.0 * z * (1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0))))));
}
