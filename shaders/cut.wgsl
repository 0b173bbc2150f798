// Integrals over what a pressure leaves of a face: twin of src/backend/gpu/cut.rs, same functions in the same order; there
// is said what they compute.

@group(0) @binding(8) var<uniform> gauss: array<vec4<f32>, GAUSS_POINTS>;

struct Sums {
    e: vec2<f32>,
    r: f32,
    length: f32,
    ye: vec4<f32>,
    yr: vec2<f32>,
    h_near: vec3<f32>,
    h_far: vec3<f32>,
}

struct Centre {
    c: vec2<f32>,
    y: vec2<f32>,
    p: vec3<f32>,
    omega: f32,
    near: bool,
}

// Of 1, x1, x2 and of x1^2, x1 x2, x2^2.
struct AreaMoments {
    low: vec3<f32>,
    high: vec3<f32>,
}

// The pressed part of an edge, and where it crosses the zero-pressure line.
struct Cut {
    a: vec2<f32>,
    b: vec2<f32>,
    x: vec2<f32>,
    crosses: bool,
    leaves: bool,
}

struct Part {
    moments: AreaMoments,
    // Of the weights 1, x1, x2.
    one: vec3<f32>,
    x1: vec3<f32>,
    x2: vec3<f32>,
    // 11, 12, 13 and 22, 23, 33.
    hessian_1: vec3<f32>,
    hessian_2: vec3<f32>,
    error: vec2<f32>,
    length: f32,
    lowest: f32,
}

fn add_moments(m: ptr<function, AreaMoments>, a: vec2<f32>, b: vec2<f32>) {
    let cross_ = a.x * b.y - a.y * b.x;
    (*m).low += vec3(cross_ / 2.0, cross_ * (a.x + b.x) / 6.0, cross_ * (a.y + b.y) / 6.0);
    (*m).high += vec3(
        cross_ * (a.x * a.x + a.x * b.x + b.x * b.x) / 12.0,
        cross_ * (2.0 * (a.x * a.y + b.x * b.y) + (a.x * b.y + b.x * a.y)) / 24.0,
        cross_ * (a.y * a.y + a.y * b.y + b.y * b.y) / 12.0,
    );
}

fn add_near(s: ptr<function, Sums>, a: vec2<f32>, b: vec2<f32>, t: vec2<f32>, l: f32, p: vec3<f32>) {
    let n = vec2(t.y, -t.x);
    let h = a.x * t.y - a.y * t.x;
    if abs(h) <= ON_LINE {
        return;
    }
    let s1 = t.x * a.x + t.y * a.y;
    let s2 = t.x * b.x + t.y * b.y;
    let r1 = sqrt(h * h + s1 * s1);
    let r2 = sqrt(h * h + s2 * s2);
    let log_ = edge_log(h, l, s1, s2, r1, r2);
    let dr = (s2 - s1) * (s2 + s1) / (r1 + r2);
    let inv = -dr / (r1 * r2);
    let ds = s2 / r2 - s1 / r1;
    let sr = s2 * r2 - s1 * r1;
    let x = h * h * log_;
    let y = h * dr;
    let z = h * inv;
    let j2 = 0.5 * (sr - x);
    let r0 = 0.5 * (sr + x);
    let m1 = dr * (r1 * r1 + r1 * r2 + r2 * r2) / 3.0;
    let k2 = log_ - ds;
    let k3 = dr + h * z;
    (*s).e += 0.5 * h * (h * n * log_ + t * dr);
    (*s).r += h / 3.0 * r0;
    let ye11 = h / 3.0 * (x * n.x * n.x + 2.0 * y * n.x * t.x + t.x * t.x * j2);
    let ye12 = h / 3.0 * (x * n.x * n.y + y * (n.x * t.y + n.y * t.x) + t.x * t.y * j2);
    let ye22 = h / 3.0 * (x * n.y * n.y + 2.0 * y * n.y * t.y + t.y * t.y * j2);
    (*s).ye += vec4(ye11, ye12, ye12, ye22);
    (*s).yr += h / 4.0 * (h * n * r0 + t * m1);
    let pn = dot(p.yz, n);
    let pt = dot(p.yz, t);
    let nn = h * (p.x * ds + 0.5 * h * (pn * ds - pt * z));
    let nt = h * (0.5 * h * (pt * k2 - pn * z) - p.x * z);
    let tt = h * p.x * k2 + 0.5 * h * (h * pn * k2 + pt * k3);
    (*s).h_near += vec3(
        nn * n.x * n.x + 2.0 * nt * n.x * t.x + tt * t.x * t.x,
        nn * n.x * n.y + nt * (n.x * t.y + n.y * t.x) + tt * t.x * t.y,
        nn * n.y * n.y + 2.0 * nt * n.y * t.y + tt * t.y * t.y,
    );
}

fn add_far(s: ptr<function, Sums>, at: Centre, z: vec2<f32>, t: vec2<f32>, weight: f32) {
    let d = at.y;
    let y = d + at.omega * z;
    let r = sqrt(y.x * y.x + y.y * y.y);
    let r0 = sqrt(d.x * d.x + d.y * d.y);
    let e = y / r;
    let over = (2.0 * (d.x * z.x + d.y * z.y) + at.omega * (z.x * z.x + z.y * z.y)) / (r + r0);
    let q = z - over * e;
    let turn = (y.x * t.y - y.y * t.x) * weight / (r * r);
    let a0 = turn * over * (r0 + 0.5 * at.omega * over);
    let a1 = turn * over * over * (0.5 * r0 + at.omega * over / 3.0);
    let a2 = turn * over * over * over * (r0 / 3.0 + 0.25 * at.omega * over);
    let qe = q.x * e.x + q.y * e.y;
    (*s).e += e * a0;
    (*s).r += qe * a0 + a1;
    let w = q * a0 + e * a1;
    (*s).ye += vec4(w.x * e, w.y * e);
    (*s).yr += qe * w + (q * a1 + e * a2);
    let along = dot(at.p.yz, e);
    let pressed = turn * over * (at.p.x + dot(at.p.yz, q) + 0.5 * over * along);
    let m3 = q.x * e.y - q.y * e.x;
    (*s).h_near += pressed * vec3(e.x * e.x, e.x * e.y, e.y * e.y);
    (*s).h_far += pressed * m3 * vec3(e, m3);
}

fn add_edge(s: ptr<function, Sums>, m: ptr<function, AreaMoments>, at: Centre, a: vec2<f32>, b: vec2<f32>) {
    let d = b - a;
    let l = sqrt(d.x * d.x + d.y * d.y);
    if l <= ON_LINE {
        return;
    }
    let t = d / l;
    add_moments(m, a, b);
    (*s).length += l;
    if at.near {
        add_near(s, a - at.c, b - at.c, t, l, at.p);
    } else {
        // Written out: some drivers count the steps of all loops.
        add_far(s, at, a + gauss[0].x * d, t, l * gauss[0].y);
        add_far(s, at, a + gauss[1].x * d, t, l * gauss[1].y);
        add_far(s, at, a + gauss[2].x * d, t, l * gauss[2].y);
        add_far(s, at, a + gauss[3].x * d, t, l * gauss[3].y);
        add_far(s, at, a + gauss[4].x * d, t, l * gauss[4].y);
        add_far(s, at, a + gauss[5].x * d, t, l * gauss[5].y);
    }
}

// From the first one to the end of the edges.
fn face_edges(header: ContactHeader, face: u32) -> vec2<u32> {
    if face == 1u && header.faces == 2u {
        return vec2(header.edges_ii, header.edges_end);
    }
    return vec2(header.edges_i, header.edges_ii);
}

fn cut_edge(a: vec2<f32>, b: vec2<f32>, pa: f32, pb: f32) -> Cut {
    let crosses = (pa < 0.0) != (pb < 0.0);
    let leaves = pb < 0.0;
    let x = a + pa / (pa - pb) * (b - a);
    var cut = Cut(a, b, x, crosses, leaves);
    if crosses && leaves {
        cut.b = x;
    } else if crosses {
        cut.a = x;
    }
    return cut;
}

fn integrate(header: ContactHeader, face: u32, v: vec3<f32>, p: vec3<f32>) -> Part {
    let speed = v.x * v.x + v.y * v.y;
    let near = speed <= FAR_LIMIT * FAR_LIMIT * header.radius * header.radius * v.z * v.z;
    let sense = select(1.0, -1.0, v.z < 0.0);
    var at = Centre(vec2(0.0), vec2(0.0), p, abs(v.z), near);
    if near {
        at.c = vec2(-v.y, v.x) / v.z;
        at.p.x = p.x + p.y * at.c.x + p.z * at.c.y;
    } else {
        at.y = sense * vec2(v.y, -v.x);
    }
    var s = Sums(vec2(0.0), 0.0, 0.0, vec4(0.0), vec2(0.0), vec3(0.0), vec3(0.0));
    var moments = AreaMoments(vec3(0.0), vec3(0.0));
    var lowest = LARGEST;
    var crossed = false;
    var first = vec2(0.0);
    let range = face_edges(header, face);
    for (var i = range.x; i < range.y; i++) {
        let edge = edges[i];
        var a = edge.xy;
        var b = edge.zw;
        let pa = p.x + p.y * a.x + p.z * a.y;
        let pb = p.x + p.y * b.x + p.z * b.y;
        lowest = min(pb, lowest);
        if pa < 0.0 && pb < 0.0 {
            continue;
        }
        let cut = cut_edge(a, b, pa, pb);
        a = cut.a;
        b = cut.b;
        // The pressed part, and then what closes the boundary.
        let parts = select(1u, 2u, cut.crosses && crossed);
        for (var part = 0u; part < parts; part++) {
            add_edge(&s, &moments, at, a, b);
            a = select(first, cut.x, cut.leaves);
            b = select(cut.x, first, cut.leaves);
        }
        if cut.crosses && !crossed {
            crossed = true;
            first = cut.x;
        }
    }
    let c = at.c;
    let torque = c.x * s.e.x + c.y * s.e.y + s.r;
    let own = vec3(-s.e.y, s.e.x, torque);
    let by_x1 = vec3(-s.ye.y, s.ye.x, c.x * s.ye.x + c.y * s.ye.y + s.yr.x);
    let by_x2 = vec3(-s.ye.w, s.ye.z, c.x * s.ye.z + c.y * s.ye.w + s.yr.y);
    var hessian_1 = vec3(s.h_near.x, s.h_near.y, s.h_far.x);
    var hessian_2 = vec3(s.h_near.z, s.h_far.y, s.h_far.z);
    if near {
        let h11 = s.h_near.x / at.omega;
        let h12 = s.h_near.y / at.omega;
        let h22 = s.h_near.z / at.omega;
        let h13 = -c.y * h11 + c.x * h12;
        let h23 = -c.y * h12 + c.x * h22;
        hessian_1 = vec3(h11, h12, h13);
        hessian_2 = vec3(h22, h23, -c.y * h13 + c.x * h23);
    }
    let away = sqrt(c.x * c.x + c.y * c.y);
    let reach = away + header.radius;
    let slope = sqrt(p.y * p.y + p.z * p.z);
    let force = (abs(at.p.x) + slope * reach) * s.length * reach;
    return Part(
        moments,
        sense * own,
        sense * (c.x * own + by_x1),
        sense * (c.y * own + by_x2),
        hessian_1,
        hessian_2,
        ROUNDING * force * vec2(1.0, away + reach),
        s.length,
        lowest,
    );
}

fn pressed_moments(header: ContactHeader, face: u32, p: vec3<f32>) -> AreaMoments {
    var moments = AreaMoments(vec3(0.0), vec3(0.0));
    var crossed = false;
    var first = vec2(0.0);
    let range = face_edges(header, face);
    for (var i = range.x; i < range.y; i++) {
        let edge = edges[i];
        let a = edge.xy;
        let b = edge.zw;
        let pa = p.x + p.y * a.x + p.z * a.y;
        let pb = p.x + p.y * b.x + p.z * b.y;
        if pa < 0.0 && pb < 0.0 {
            continue;
        }
        let cut = cut_edge(a, b, pa, pb);
        add_moments(&moments, cut.a, cut.b);
        if cut.crosses && crossed {
            add_moments(&moments, select(first, cut.x, cut.leaves), select(cut.x, first, cut.leaves));
        }
        if cut.crosses && !crossed {
            crossed = true;
            first = cut.x;
        }
    }
    return moments;
}

fn face_pressure(q: vec4<f32>, face: u32) -> vec3<f32> {
    return select(vec3(q.y, -q.zw), vec3(q.x, q.zw), face == 0u);
}
