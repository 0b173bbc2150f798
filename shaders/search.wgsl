// The search for the best twist of one load: twin of src/backend/search.rs, same functions in the same order; there is
// said what they compute. One invocation takes one load; the twists pass through workgroup memory in tiles.

@group(0) @binding(0) var<storage, read> contacts: array<ContactHeader>;
@group(0) @binding(1) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> twists: array<TwistRecord>;
@group(0) @binding(3) var<storage, read> basis: array<vec4<f32>>;

// Congruent faces: the twist over its dissipation. Otherwise the twist, and the dissipation's parts per pressure.
var<workgroup> tile_twist: array<vec4<f32>, GROUP>;
var<workgroup> tile_parts: array<vec4<f32>, GROUP>;

// p_I = at_i + slope.x, p_II = at_ii - slope.x
struct Planes {
    at_i: f32,
    at_ii: f32,
    slope: vec2<f32>,
    full: bool,
}

// Gradient at a twist on a face for the weight 1, x1 or x2, and its product with the twist.
fn gradient(header: ContactHeader, face: u32, weight: u32, twist: u32) -> vec4<f32> {
    return basis[header.basis + (face * arrayLength(&twists) + twist) * BASIS + weight];
}

fn free_share(header: ContactHeader, mean_i: f32, mean_ii: f32, slope: vec2<f32>) -> f32 {
    var drop_i = 0.0;
    for (var i = header.edges_i; i < header.edges_ii; i++) {
        drop_i = max(drop_i, -dot(slope, edges[i].xy - header.centroid_i));
    }
    var drop_ii = 0.0;
    for (var i = header.edges_ii; i < header.edges_end; i++) {
        drop_ii = max(drop_ii, dot(slope, edges[i].xy - header.centroid_ii));
    }
    // Exactly 1 where nothing lifts: a quotient of equal numbers need not be.
    return min(select(1.0, mean_i / drop_i, drop_i > mean_i), select(1.0, mean_ii / drop_ii, drop_ii > mean_ii));
}

fn planes(header: ContactHeader, load: LoadRecord) -> Planes {
    let n_i = 1.0 + 0.5 * load.f3;
    let n_ii = 1.0 - 0.5 * load.f3;
    let mean_i = n_i / header.area_i;
    let mean_ii = n_ii / header.area_ii;
    if header.faces == 1u {
        return Planes(mean_i, mean_ii, vec2(0.0), true);
    }
    let ci = header.centroid_i;
    let cii = header.centroid_ii;
    let k = header.compliance;
    let right = vec2(-load.m2, load.m1) - n_i * ci + n_ii * cii;
    let whole = vec2(k.x * right.x + k.y * right.y, k.y * right.x + k.z * right.y);
    var share = free_share(header, mean_i, mean_ii, whole);
    let full_contact = share >= 1.0;
    if !full_contact {
        share = TILT_LIMIT * share;
    }
    let slope = share * whole;
    return Planes(mean_i - slope.x * ci.x - slope.y * ci.y, mean_ii + slope.x * cii.x + slope.y * cii.y, slope, full_contact);
}

fn sign_of(entry: u32) -> f32 {
    return select(1.0, -1.0, (entry & NEGATED) != 0u);
}

// Gradient of the dissipation at the twist of a ring entry.
fn support(header: ContactHeader, p: Planes, entry: u32) -> vec3<f32> {
    let twist = entry & ~NEGATED;
    let one = gradient(header, 0u, 0u, twist).xyz;
    if header.faces == 1u {
        return sign_of(entry) * ((p.at_i + p.at_ii) * one);
    }
    let x1 = gradient(header, 0u, 1u, twist).xyz - gradient(header, 1u, 1u, twist).xyz;
    let x2 = gradient(header, 0u, 2u, twist).xyz - gradient(header, 1u, 2u, twist).xyz;
    return sign_of(entry) * (p.at_i * one + p.at_ii * gradient(header, 1u, 0u, twist).xyz + p.slope.x * x1 + p.slope.y * x2);
}

fn full_contact(header: ContactHeader, load: LoadRecord, mu: f32, g0: vec2<f32>, g1: vec2<f32>, g2: vec2<f32>) -> bool {
    if load.distance >= OUT_OF_RANGE || header.resolved == 0u {
        return false;
    }
    let reach = 0.5 * load.distance * mu;
    let k = header.compliance;
    let x11 = 2.0 * reach * (k.x * g1.x + k.y * g1.y);
    let x12 = 2.0 * reach * (k.x * g2.x + k.y * g2.y);
    let x21 = 2.0 * reach * (k.y * g1.x + k.z * g1.y);
    let x22 = 2.0 * reach * (k.y * g2.x + k.z * g2.y);
    let trace = x11 + x22;
    let det = x11 * x22 - x12 * x21;
    let whole = 1.0 - trace + det;
    var lowest = whole;
    if det > 0.0 && trace > 0.0 && trace < 2.0 * det {
        lowest = 1.0 - 0.25 * trace * trace / det;
    }
    if !(lowest >= COUPLING_MARGIN) {
        return false;
    }
    let right = vec2(-load.m2, load.m1) + reach * load.f3 / header.area_i * g0;
    let b = vec2(k.x * right.x + k.y * right.y, k.y * right.x + k.z * right.y);
    let slope = vec2((1.0 - x22) * b.x + x12 * b.y, x21 * b.x + (1.0 - x11) * b.y) / whole;
    let without = vec2(-k.x * load.m2 + k.y * load.m1, -k.y * load.m2 + k.z * load.m1);
    let drop_i = (1.0 + 0.5 * load.f3 - CONTACT_MARGIN) / header.area_i;
    let drop_ii = (1.0 - 0.5 * load.f3 - CONTACT_MARGIN) / header.area_ii;
    for (var i = header.edges_i; i < header.edges_ii; i++) {
        let point = edges[i].xy;
        let coupled = slope.x * point.x + slope.y * point.y;
        let uncoupled = without.x * point.x + without.y * point.y;
        if !(max(coupled, uncoupled) <= drop_ii && -min(coupled, uncoupled) <= drop_i) {
            return false;
        }
    }
    return true;
}

fn coupled_share(header: ContactHeader, load: LoadRecord, p: Planes, upper: f32) -> f32 {
    let mu = load.scale * upper;
    if load.distance >= OUT_OF_RANGE || header.resolved == 0u || !p.full || mu * mu * load.distance * load.distance > 0.5 * (header.area_i + header.area_ii) {
        return -1.0;
    }
    var far = 0.0;
    var pressure = 1.0;
    for (var i = header.edges_i; i < header.edges_end; i++) {
        let on_i = i < header.edges_ii;
        let along = p.slope.x * edges[i].x + p.slope.y * edges[i].y;
        let offset = edges[i].xy - select(header.centroid_ii, header.centroid_i, on_i);
        let here = select(p.at_ii - along, p.at_i + along, on_i);
        let least = CONTACT_MARGIN * select(abs(p.at_ii), abs(p.at_i), on_i);
        if !(here > least) {
            return -1.0;
        }
        let distance = offset.x * offset.x + offset.y * offset.y;
        if distance * pressure > far * here * here {
            far = distance;
            pressure = here * here;
        }
    }
    let q = header.variation_first;
    let r = header.variation_second;
    let z1 = p.at_i;
    let z2 = p.at_ii;
    let z3 = p.slope.x;
    let z4 = p.slope.y;
    let square = q.x * z1 * z1 + q.y * z2 * z2 + q.w * z3 * z3 + header.variation_slope.y * z4 * z4;
    let mixed = z1 * (q.z * z2 + r.x * z3 + r.y * z4) + z2 * (r.z * z3 + r.w * z4) + header.variation_slope.x * z3 * z4;
    let variation = sqrt(max(square + 2.0 * mixed, 0.0)) + LEAST_VARIATION;
    let reach = 0.5 * header.softness * abs(load.distance) * mu;
    let c = 1.0 - reach * header.spread;
    let b = reach * variation * sqrt(far / pressure);
    if c <= 0.0 || c * c <= 4.0 * b {
        return -1.0;
    }
    let share = 2.0 * b / (c + sqrt(c * c - 4.0 * b));
    return select(-1.0, share, share <= COUPLED_SHARE);
}

// What the ring round the best twist says of one load.
struct Corner {
    twist: vec3<f32>,
    upper: f32,
    // Integrals over face I of v/|v|, x1 v/|v|, x2 v/|v| at that twist.
    g: array<vec2<f32>, 3>,
}

// Bound and interpolated twist from the triangles round the best twist. In each triangle w = a ga + b gb + c gc by
// Cramer's rule; two of its numerators are products with ga x w.
fn corner(header: ContactHeader, load: LoadRecord, p: Planes, best: u32) -> Corner {
    let own = twists[best].twist.xyz;
    let sense = select(1.0, -1.0, dot(load.wrench, own) < 0.0);
    let w = sense * load.wrench;
    let ga = support(header, p, best);
    let u = cross(ga, w);
    var upper = LARGEST;
    var triangle = vec3(best);
    var share = vec3(0.0);
    var here = twists[best].ring[0];
    var gb = support(header, p, here);
    for (var i = 0u; i < RING; i++) {
        let next = twists[best].ring[(i + 1u) % RING];
        let gc = support(header, p, next);
        let normal = cross(gb, gc);
        let det = dot(ga, normal);
        if abs(det) > DEGENERATE {
            let numerators = select(1.0, -1.0, det < 0.0) * vec3(dot(w, normal), dot(u, gc), -dot(u, gb));
            let sum = abs(numerators.x) + abs(numerators.y) + abs(numerators.z);
            let total = sum / abs(det);
            if total < upper && sum > 0.0 {
                upper = total;
                triangle = vec3(best, here, next);
                share = numerators / sum;
            }
        }
        here = next;
        gb = gc;
    }
    share = sense * share * vec3(1.0, sign_of(triangle.y), sign_of(triangle.z));
    triangle = triangle & vec3(~NEGATED);
    var twist = share.x * twists[triangle.x].twist.xyz + share.y * twists[triangle.y].twist.xyz + share.z * twists[triangle.z].twist.xyz;
    let length = sqrt(dot(twist, twist));
    if length > 0.5 {
        twist = twist / length;
    } else {
        twist = sense * own;
    }
    var g: array<vec2<f32>, 3>;
    for (var weight = 0u; weight < 3u && header.faces == 1u; weight++) {
        g[weight] = share.x * gradient(header, 0u, weight, triangle.x).xy
            + share.y * gradient(header, 0u, weight, triangle.y).xy
            + share.z * gradient(header, 0u, weight, triangle.z).xy;
    }
    return Corner(twist, upper, g);
}

fn finish(header: ContactHeader, load: LoadRecord, p: Planes, best: u32, value: f32) -> SeedRecord {
    let found = corner(header, load, p, best);
    var upper = found.upper;
    var lower = value;
    var status = UNBOUNDED;
    if header.faces == 1u && upper < LARGEST {
        if full_contact(header, load, load.scale * upper, found.g[0], found.g[1], found.g[2]) {
            status = BOUNDED;
        }
    }
    if header.faces == 2u && upper < LARGEST {
        let coupled = coupled_share(header, load, p, upper);
        if coupled >= 0.0 {
            status = COUPLED;
            lower = lower / (1.0 + coupled);
            upper = upper / (1.0 - coupled);
        }
    }
    return SeedRecord(found.twist, lower, upper, status, best, 0u);
}

// A twist and the value of a load there.
struct Best {
    twist: u32,
    value: f32,
}

// The best twist of the load of each invocation of a workgroup, all on one contact.
fn search(header: ContactHeader, load: LoadRecord, p: Planes, lane: u32) -> Best {
    let w = load.wrench;
    let pressure = vec4(p.at_i, p.at_ii, p.slope);
    let count = arrayLength(&twists);
    let congruent = header.faces == 1u;
    let mean = 2.0 / header.area_i;
    // The best quotient value / least: power over dissipation, compared without a division for each.
    var best = 0u;
    var value = -1.0;
    var least = 1.0;
    for (var first = 0u; first < count; first += GROUP) {
        let k = first + lane;
        if k < count {
            let one = gradient(header, 0u, 0u, k).w;
            if congruent {
                tile_twist[lane] = twists[k].twist / (mean * one);
            } else {
                tile_twist[lane] = twists[k].twist;
                tile_parts[lane] = vec4(
                    one,
                    gradient(header, 1u, 0u, k).w,
                    gradient(header, 0u, 1u, k).w - gradient(header, 1u, 1u, k).w,
                    gradient(header, 0u, 2u, k).w - gradient(header, 1u, 2u, k).w,
                );
            }
        }
        workgroupBarrier();
        let tile = min(GROUP, count - first);
        if congruent {
            for (var j = 0u; j < tile; j++) {
                let mu = abs(dot(w, tile_twist[j].xyz));
                if mu > value {
                    value = mu;
                    best = first + j;
                }
            }
        } else {
            for (var j = 0u; j < tile; j++) {
                let power = abs(dot(w, tile_twist[j].xyz));
                let d = max(dot(pressure, tile_parts[j]), LEAST_DISSIPATION);
                if power * least > value * d {
                    value = power;
                    least = d;
                    best = first + j;
                }
            }
        }
        workgroupBarrier();
    }
    return Best(best, value / least);
}
