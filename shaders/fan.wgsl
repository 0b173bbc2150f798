// Gradient basis of one contact at one twist: twin of src/backend/fan.rs, same functions in the same order; there is
// said what they compute and how well.

@group(0) @binding(0) var<storage, read> contacts: array<ContactHeader>;
@group(0) @binding(1) var<storage, read> edges: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> twists: array<TwistRecord>;
@group(0) @binding(3) var<storage, read_write> basis_out: array<vec4<f32>>;
@group(0) @binding(4) var<uniform> gauss: array<vec4<f32>, GAUSS_POINTS>;

// Rows: weights 1, x1, x2; in each g1, g2, torque.
struct Basis {
    one: vec3<f32>,
    x1: vec3<f32>,
    x2: vec3<f32>,
}

struct Fan {
    e: vec2<f32>,
    r: f32,
    ye: vec3<f32>,
    yr: vec2<f32>,
}

fn fan(first: u32, end: u32, c: vec2<f32>) -> Fan {
    var sum = Fan(vec2(0.0), 0.0, vec3(0.0), vec2(0.0));
    for (var i = first; i < end; i++) {
        let edge = edges[i];
        let a = edge.xy - c;
        let b = edge.zw - c;
        let d = edge.zw - edge.xy;
        let l = sqrt(d.x * d.x + d.y * d.y);
        let t = d / l;
        let n = vec2(t.y, -t.x);
        let h = a.x * t.y - a.y * t.x;
        if abs(h) <= ON_LINE {
            continue;
        }
        let s1 = t.x * a.x + t.y * a.y;
        let s2 = t.x * b.x + t.y * b.y;
        let r1 = sqrt(h * h + s1 * s1);
        let r2 = sqrt(h * h + s2 * s2);
        let log_ = edge_log(h, l, s1, s2, r1, r2);
        let dr = (s2 - s1) * (s2 + s1) / (r1 + r2);
        let sr = s2 * r2 - s1 * r1;
        let h2log = h * h * log_;
        let j2 = 0.5 * (sr - h2log);
        let r0 = 0.5 * (sr + h2log);
        let m1 = dr * (r1 * r1 + r1 * r2 + r2 * r2) / 3.0;
        sum.e += 0.5 * h * (h * n * log_ + t * dr);
        sum.r += h / 3.0 * r0;
        sum.ye += h / 3.0 * vec3(
            h2log * n.x * n.x + 2.0 * h * n.x * t.x * dr + t.x * t.x * j2,
            h2log * n.x * n.y + h * (n.x * t.y + n.y * t.x) * dr + t.x * t.y * j2,
            h2log * n.y * n.y + 2.0 * h * n.y * t.y * dr + t.y * t.y * j2,
        );
        sum.yr += h / 4.0 * (h * n * r0 + t * m1);
    }
    return sum;
}

fn basis_near(first: u32, end: u32, v: vec3<f32>) -> Basis {
    let c = vec2(-v.y / v.z, v.x / v.z);
    let f = fan(first, end, c);
    let sense = select(-1.0, 1.0, v.z > 0.0);
    let torque = c.x * f.e.x + c.y * f.e.y + f.r;
    return Basis(
        sense * vec3(-f.e.y, f.e.x, torque),
        sense * vec3(-(c.x * f.e.y + f.ye.y), c.x * f.e.x + f.ye.x, c.x * torque + c.x * f.ye.x + c.y * f.ye.y + f.yr.x),
        sense * vec3(-(c.y * f.e.y + f.ye.z), c.y * f.e.x + f.ye.y, c.y * torque + c.x * f.ye.y + c.y * f.ye.z + f.yr.y),
    );
}

fn basis_far(first: u32, end: u32, v: vec3<f32>) -> Basis {
    var total = Basis(vec3(0.0), vec3(0.0), vec3(0.0));
    for (var i = first; i < end; i++) {
        let edge = edges[i];
        var sum = Basis(vec3(0.0), vec3(0.0), vec3(0.0));
        let twice_area = edge.x * edge.w - edge.y * edge.z;
        for (var j = 0u; j < GAUSS_POINTS; j++) {
            let across = gauss[j];
            let p = edge.xy + across.x * (edge.zw - edge.xy);
            for (var k = 0u; k < GAUSS_POINTS; k++) {
                let along = gauss[k];
                let x = along.x * p;
                let velocity = vec2(v.x - v.z * x.y, v.y + v.z * x.x);
                let weight = twice_area * across.y * along.y * along.x / sqrt(velocity.x * velocity.x + velocity.y * velocity.y);
                let g = vec3(weight * velocity, x.x * weight * velocity.y - x.y * weight * velocity.x);
                sum.one += g;
                sum.x1 += x.x * g;
                sum.x2 += x.y * g;
            }
        }
        total.one += sum.one;
        total.x1 += sum.x1;
        total.x2 += sum.x2;
    }
    return total;
}

fn basis(first: u32, end: u32, radius: f32, v: vec3<f32>) -> Basis {
    let near = v.x * v.x + v.y * v.y <= NEAR_LIMIT * NEAR_LIMIT * radius * radius * v.z * v.z;
    if near {
        return basis_near(first, end, v);
    }
    return basis_far(first, end, v);
}

// One invocation per twist and contact; the array is [contact][face][twist][weight].
@compute @workgroup_size(BASIS_GROUP)
fn fill_basis(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = arrayLength(&twists);
    let k = id.x;
    if k >= count || id.y >= arrayLength(&contacts) {
        return;
    }
    let header = contacts[id.y];
    for (var face = 0u; face < header.faces; face++) {
        let first = select(header.edges_ii, header.edges_i, face == 0u);
        let end = select(header.edges_end, header.edges_ii, face == 0u);
        let v = twists[k].twist.xyz;
        let g = basis(first, end, header.radius, v);
        let out = header.basis + (face * count + k) * BASIS;
        basis_out[out] = vec4(g.one, dot(v, g.one));
        basis_out[out + 1u] = vec4(g.x1, dot(v, g.x1));
        basis_out[out + 2u] = vec4(g.x2, dot(v, g.x2));
    }
}
