// The search for the best twist of one load: twin of src/backend/search.rs, same functions in the same order; there is
// said what they compute. One workgroup takes a group of loads on one contact, one invocation per load; the twists
// pass through workgroup memory in tiles.

@group(0) @binding(0) var<storage, read> contacts: array<ContactHeader>;
@group(0) @binding(1) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> twists: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> rings: array<u32>;
@group(0) @binding(4) var<storage, read> basis: array<f32>;
@group(0) @binding(5) var<storage, read> loads: array<LoadRecord>;
@group(0) @binding(6) var<storage, read> groups: array<GroupRecord>;
@group(0) @binding(7) var<storage, read_write> seeds: array<SeedRecord>;

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

fn component(header: ContactHeader, face: u32, index: u32, twist: u32) -> f32 {
    return basis[header.basis + (face * BASIS + index) * arrayLength(&twists) + twist];
}

fn free_share(header: ContactHeader, mean_i: f32, mean_ii: f32, slope: vec2<f32>) -> f32 {
    var share = 1.0;
    for (var i = header.edges_i; i < header.edges_end; i++) {
        let on_i = i < header.edges_ii;
        let centroid = select(header.centroid_ii, header.centroid_i, on_i);
        let mean = select(mean_ii, mean_i, on_i);
        let sign = select(-1.0, 1.0, on_i);
        let drop = -sign * (slope.x * (edges[i].x - centroid.x) + slope.y * (edges[i].y - centroid.y));
        if drop * share > mean {
            share = mean / drop;
        }
    }
    return share;
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
    let full = vec2(k.x * right.x + k.y * right.y, k.y * right.x + k.z * right.y);
    var share = free_share(header, mean_i, mean_ii, full);
    let full_contact = share >= 1.0;
    if !full_contact {
        share = TILT_LIMIT * share;
    }
    let slope = share * full;
    return Planes(mean_i - slope.x * ci.x - slope.y * ci.y, mean_ii + slope.x * cii.x + slope.y * cii.y, slope, full_contact);
}

fn support_component(header: ContactHeader, p: Planes, twist: u32, m: u32) -> f32 {
    if header.faces == 1u {
        return (p.at_i + p.at_ii) * component(header, 0u, m, twist);
    }
    return p.at_i * component(header, 0u, m, twist)
        + p.at_ii * component(header, 1u, m, twist)
        + p.slope.x * (component(header, 0u, 3u + m, twist) - component(header, 1u, 3u + m, twist))
        + p.slope.y * (component(header, 0u, 6u + m, twist) - component(header, 1u, 6u + m, twist));
}

fn sign_of(entry: u32) -> f32 {
    return select(1.0, -1.0, (entry & NEGATED) != 0u);
}

fn support(header: ContactHeader, p: Planes, entry: u32) -> vec3<f32> {
    let twist = entry & ~NEGATED;
    return sign_of(entry)
        * vec3(support_component(header, p, twist, 0u), support_component(header, p, twist, 1u), support_component(header, p, twist, 2u));
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
    let q = header.variation_first;
    let r = header.variation_second;
    let z1 = p.at_i;
    let z2 = p.at_ii;
    let z3 = p.slope.x;
    let z4 = p.slope.y;
    let square = q.x * z1 * z1 + q.y * z2 * z2 + q.w * z3 * z3 + header.variation_slope.y * z4 * z4;
    let mixed = z1 * (q.z * z2 + r.x * z3 + r.y * z4) + z2 * (r.z * z3 + r.w * z4) + header.variation_slope.x * z3 * z4;
    let variation = sqrt(max(square + 2.0 * mixed, 0.0)) + LEAST_VARIATION;
    var steepest = 0.0;
    for (var i = header.edges_i; i < header.edges_end; i++) {
        let on_i = i < header.edges_ii;
        let along = p.slope.x * edges[i].x + p.slope.y * edges[i].y;
        let offset = edges[i].xy - select(header.centroid_ii, header.centroid_i, on_i);
        let pressure = select(p.at_ii - along, p.at_i + along, on_i);
        let least = CONTACT_MARGIN * select(abs(p.at_ii), abs(p.at_i), on_i);
        if pressure <= least {
            return -1.0;
        }
        steepest = max(steepest, (offset.x * offset.x + offset.y * offset.y) / (pressure * pressure));
    }
    let reach = 0.5 * header.softness * abs(load.distance) * mu;
    let c = 1.0 - reach * header.spread;
    let b = reach * variation * sqrt(steepest);
    if c <= 0.0 || c * c <= 4.0 * b {
        return -1.0;
    }
    let share = 2.0 * b / (c + sqrt(c * c - 4.0 * b));
    return select(-1.0, share, share <= COUPLED_SHARE);
}

fn twist_of(entry: u32) -> vec3<f32> {
    return sign_of(entry) * twists[entry & ~NEGATED].xyz;
}

fn mix_component(header: ContactHeader, triangle: vec3<u32>, share: vec3<f32>, index: u32) -> f32 {
    return sign_of(triangle.x) * share.x * component(header, 0u, index, triangle.x & ~NEGATED)
        + sign_of(triangle.y) * share.y * component(header, 0u, index, triangle.y & ~NEGATED)
        + sign_of(triangle.z) * share.z * component(header, 0u, index, triangle.z & ~NEGATED);
}

fn finish(header: ContactHeader, load: LoadRecord, p: Planes, best_twist: u32, value: f32) -> SeedRecord {
    let w = load.wrench;
    var best = best_twist;
    if dot(w, twist_of(best)) < 0.0 {
        best = best ^ NEGATED;
    }
    let flip = best & NEGATED;
    let ring = RING * (best & ~NEGATED);
    let ga = support(header, p, best);
    var upper = LARGEST;
    var triangle = vec3(best);
    var share = vec3(1.0, 0.0, 0.0);
    var here = rings[ring] ^ flip;
    var gb = support(header, p, here);
    for (var i = 0u; i < RING; i++) {
        let next = rings[ring + (i + 1u) % RING] ^ flip;
        let gc = support(header, p, next);
        let normal = cross(gb, gc);
        let det = dot(ga, normal);
        if abs(det) > DEGENERATE {
            let shares = vec3(dot(w, normal), dot(w, cross(gc, ga)), dot(w, cross(ga, gb))) / det;
            let total = abs(shares.x) + abs(shares.y) + abs(shares.z);
            if total < upper {
                upper = total;
                triangle = vec3(best, here, next);
                share = shares / total;
            }
        }
        here = next;
        gb = gc;
    }
    var twist = share.x * twist_of(triangle.x) + share.y * twist_of(triangle.y) + share.z * twist_of(triangle.z);
    let length = sqrt(dot(twist, twist));
    if length > 0.5 {
        twist = twist / length;
    } else {
        twist = twist_of(best);
    }
    var status = UNBOUNDED;
    if header.faces == 1u && upper < LARGEST {
        let g0 = vec2(mix_component(header, triangle, share, 0u), mix_component(header, triangle, share, 1u));
        let g1 = vec2(mix_component(header, triangle, share, 3u), mix_component(header, triangle, share, 4u));
        let g2 = vec2(mix_component(header, triangle, share, 6u), mix_component(header, triangle, share, 7u));
        if full_contact(header, load, load.scale * upper, g0, g1, g2) {
            status = BOUNDED;
        }
    }
    var lower = value;
    if header.faces == 2u && upper < LARGEST {
        let coupled = coupled_share(header, load, p, upper);
        if coupled >= 0.0 {
            status = COUPLED;
            lower = lower / (1.0 + coupled);
            upper = upper / (1.0 - coupled);
        }
    }
    return SeedRecord(twist, lower, upper, status, best & ~NEGATED, 0u);
}

// Product of a twist with its part of the gradient basis: the dissipation's part for one face and weight.
fn part(header: ContactHeader, face: u32, weight: u32, k: u32) -> f32 {
    let v = twists[k];
    return v.x * component(header, face, 3u * weight, k)
        + v.y * component(header, face, 3u * weight + 1u, k)
        + v.z * component(header, face, 3u * weight + 2u, k);
}

@compute @workgroup_size(GROUP)
fn search(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let number = workgroup.x + GRID * workgroup.y;
    // Workgroups beyond the last repeat it without writing: every barrier is reached by all.
    let group = groups[min(number, arrayLength(&groups) - 1u)];
    let wanted = number < arrayLength(&groups) && lane < group.count;
    let header = contacts[group.contact];
    let index = group.first + min(lane, group.count - 1u);
    let load = loads[index];
    let w = load.wrench;
    let p = planes(header, load);
    let pressure = vec4(p.at_i, p.at_ii, p.slope);
    let count = arrayLength(&twists);
    let congruent = header.faces == 1u;
    let mean = 2.0 / header.area_i;
    var best = 0u;
    var value = -1.0;
    for (var first = 0u; first < count; first += GROUP) {
        let k = first + lane;
        if k < count {
            let one = part(header, 0u, 0u, k);
            if congruent {
                tile_twist[lane] = twists[k] / (mean * one);
            } else {
                tile_twist[lane] = twists[k];
                tile_parts[lane] = vec4(
                    one,
                    part(header, 1u, 0u, k),
                    part(header, 0u, 1u, k) - part(header, 1u, 1u, k),
                    part(header, 0u, 2u, k) - part(header, 1u, 2u, k),
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
                let mu = abs(dot(w, tile_twist[j].xyz)) / dot(pressure, tile_parts[j]);
                if mu > value {
                    value = mu;
                    best = first + j;
                }
            }
        }
        workgroupBarrier();
    }
    if wanted {
        seeds[index] = finish(header, load, p, best, value);
    }
}
