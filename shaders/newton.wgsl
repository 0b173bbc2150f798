// Newton's method on the loads of each grip that have no bounds: twin of src/backend/gpu/newton.rs, same functions in the
// same order; there is said what they compute. One workgroup takes a grip, or a part of its loads, and closes ranks
// before it begins: its invocations take the open loads in a row.

// Of the open loads of a part: which they are, what is known of their mu_s at most, their twists with what it is at least.
var<workgroup> places: array<u32, PART>;
var<workgroup> uppers: array<f32, PART>;
var<workgroup> slips: array<vec4<f32>, PART>;
var<workgroup> left_open: array<atomic<u32>, PART_WORDS>;
var<workgroup> gathered: atomic<u32>;
var<workgroup> count_open: u32;

struct Equations {
    v: vec3<f32>,
    q: vec4<f32>,
    slip: vec3<f32>,
    held: vec4<f32>,
    moments_i: AreaMoments,
    moments_ii: AreaMoments,
    g: vec3<f32>,
    difference: vec3<f32>,
    d: f32,
    sum_1: vec3<f32>,
    sum_2: vec3<f32>,
    less_1: vec3<f32>,
    less_2: vec3<f32>,
    one_i: vec3<f32>,
    x1_i: vec3<f32>,
    x2_i: vec3<f32>,
    one_ii: vec3<f32>,
    x1_ii: vec3<f32>,
    x2_ii: vec3<f32>,
    good: bool,
    friction_error: vec2<f32>,
    pressure_error: vec3<f32>,
}

// Of twist and pressure, and what each equation changes.
struct Step {
    v: vec3<f32>,
    q: vec4<f32>,
    by_slip: vec3<f32>,
    by_held: vec4<f32>,
}

struct Definite {
    d: vec3<f32>,
    l21: f32,
    l31: f32,
    l32: f32,
}

struct Estimate {
    twist: vec3<f32>,
    lower: f32,
    upper: f32,
}

fn carried(a: AreaMoments, b: AreaMoments, q: vec4<f32>) -> vec4<f32> {
    return vec4(
        a.low.x * q.x + a.low.y * q.z + a.low.z * q.w,
        b.low.x * q.y - b.low.y * q.z - b.low.z * q.w,
        a.low.y * q.x - b.low.y * q.y + (a.high.x + b.high.x) * q.z + (a.high.y + b.high.y) * q.w,
        a.low.z * q.x - b.low.z * q.y + (a.high.y + b.high.y) * q.z + (a.high.z + b.high.z) * q.w,
    );
}

fn press(header: ContactHeader, load: LoadRecord) -> vec4<f32> {
    let wanted = vec4(1.0 + 0.5 * load.f3, 1.0 - 0.5 * load.f3, -load.m2, load.m1);
    var q = vec4(wanted.x / header.area_i, wanted.y / header.area_ii, 0.0, 0.0);
    var step = vec4(0.0);
    var value = LARGEST;
    var error = LARGEST;
    var slope = 0.0;
    var share = 1.0;
    for (var k = 0u; k < PRESSURE_STEPS; k++) {
        let tried = q + share * step;
        let a = pressed_moments(header, 0u, face_pressure(tried, 0u));
        let b = pressed_moments(header, 1u, face_pressure(tried, 1u));
        let held = carried(a, b, tried);
        let left = held - wanted;
        let size = sqrt(dot(left, left));
        let energy = dot(tried, 0.5 * held - wanted);
        let pressed = a.low.x > 0.0 && b.low.x > 0.0;
        if !(pressed && (energy <= value + 1e-4 * share * slope || size < 0.5 * error)) {
            share *= 0.5;
            continue;
        }
        q = tried;
        value = energy;
        error = size;
        share = 1.0;
        if error <= PRESSED {
            break;
        }
        let a1 = a.low.y / a.low.x;
        let a2 = a.low.z / a.low.x;
        let b1 = b.low.y / b.low.x;
        let b2 = b.low.z / b.low.x;
        let s11 = a.high.x + b.high.x - a1 * a.low.y - b1 * b.low.y;
        let s12 = a.high.y + b.high.y - a1 * a.low.z - b1 * b.low.z;
        let s22 = a.high.z + b.high.z - a2 * a.low.z - b2 * b.low.z;
        let x1 = -left.z + a1 * left.x - b1 * left.y;
        let x2 = -left.w + a2 * left.x - b2 * left.y;
        let det = s11 * s22 - s12 * s12;
        let tilt = vec2(x1 * s22 - s12 * x2, s11 * x2 - s12 * x1) / det;
        step = vec4(
            -left.x / a.low.x - a1 * tilt.x - a2 * tilt.y,
            -left.y / b.low.x + b1 * tilt.x + b2 * tilt.y,
            tilt,
        );
        slope = dot(left, step);
    }
    return q;
}

fn definite(one: vec3<f32>, two: vec3<f32>) -> Definite {
    let l21 = one.y / one.x;
    let l31 = one.z / one.x;
    let d2 = two.x - l21 * one.y;
    let e32 = two.y - l31 * one.y;
    let l32 = e32 / d2;
    return Definite(vec3(one.x, d2, two.z - l31 * one.z - l32 * e32), l21, l31, l32);
}

fn solve(m: Definite, b: vec3<f32>) -> vec3<f32> {
    let y2 = b.y - m.l21 * b.x;
    let y3 = b.z - m.l31 * b.x - m.l32 * y2;
    let x3 = y3 / m.d.z;
    let x2 = y2 / m.d.y - m.l32 * x3;
    return vec3(b.x / m.d.x - m.l21 * x2 - m.l31 * x3, x2, x3);
}

fn put(header: ContactHeader, at: ptr<function, Equations>) {
    (*at).g = vec3(0.0);
    (*at).difference = vec3(0.0);
    (*at).sum_1 = vec3(0.0);
    (*at).sum_2 = vec3(0.0);
    (*at).less_1 = vec3(0.0);
    (*at).less_2 = vec3(0.0);
    (*at).friction_error = vec2(0.0);
    (*at).pressure_error = vec3(0.0);
    (*at).good = true;
    let radius = header.radius;
    for (var face = 0u; face < 2u; face++) {
        let p = face_pressure((*at).q, face);
        let part = integrate(header, face, (*at).v, p);
        let area = select(header.area_ii, header.area_i, face == 0u);
        let sign_ = select(-1.0, 1.0, face == 0u);
        let gradient_ = p.x * part.one + p.y * part.x1 + p.z * part.x2;
        (*at).g += gradient_;
        (*at).difference += sign_ * gradient_;
        (*at).sum_1 += part.hessian_1;
        (*at).sum_2 += part.hessian_2;
        (*at).less_1 += sign_ * part.hessian_1;
        (*at).less_2 += sign_ * part.hessian_2;
        let m = part.moments;
        let normal = dot(p, m.low);
        let slope = sqrt(p.y * p.y + p.z * p.z);
        let left = m.low.x >= LEAST_LEFT * area && slope * radius * m.low.x <= STEEPEST * normal;
        (*at).good = (*at).good && (part.lowest >= 0.0 || left);
        let held = ROUNDING * (abs(p.x) + slope * radius) * part.length * radius;
        (*at).friction_error += part.error;
        (*at).pressure_error.z += held * radius;
        if face == 0u {
            (*at).pressure_error.x = held;
            (*at).moments_i = m;
            (*at).one_i = part.one;
            (*at).x1_i = part.x1;
            (*at).x2_i = part.x2;
        } else {
            (*at).pressure_error.y = held;
            (*at).moments_ii = m;
            (*at).one_ii = part.one;
            (*at).x1_ii = part.x1;
            (*at).x2_ii = part.x2;
        }
    }
}

fn residuals(at: ptr<function, Equations>, load: LoadRecord) {
    let held = carried((*at).moments_i, (*at).moments_ii, (*at).q);
    let d = dot((*at).g, (*at).v);
    let friction = 0.5 * load.distance * load.scale * d;
    (*at).d = d;
    (*at).slip = load.wrench - d * (*at).g;
    (*at).held = vec4(
        1.0 + 0.5 * load.f3 - held.x,
        1.0 - 0.5 * load.f3 - held.y,
        load.m1 + friction * (*at).difference.y - held.w,
        load.m2 - friction * (*at).difference.x + held.z,
    );
}

struct ByPressure {
    sum: vec3<f32>,
    less: vec3<f32>,
}

fn by_pressure(at: Equations, j: u32) -> ByPressure {
    switch j {
        case 0u: {
            return ByPressure(at.one_i, at.one_i);
        }
        case 1u: {
            return ByPressure(at.one_ii, -at.one_ii);
        }
        case 2u: {
            return ByPressure(at.x1_i - at.x1_ii, at.x1_i + at.x1_ii);
        }
        default: {
            return ByPressure(at.x2_i - at.x2_ii, at.x2_i + at.x2_ii);
        }
    }
}

fn newton_step(at: Equations, load: LoadRecord) -> Step {
    let a = at.moments_i;
    let b = at.moments_ii;
    let r = at.held;
    let g = at.g;
    let v = at.v;
    let d = at.d;
    let slip = definite(g.x * g + d * at.sum_1, vec3(g.y * g.y, g.y * g.z, g.z * g.z) + d * at.sum_2);
    let lever = 0.5 * load.distance * load.scale;
    let x = at.difference.x;
    let y = at.difference.y;
    let row_v1 = lever * (g * y + d * vec3(at.less_1.y, at.less_2.x, at.less_2.y));
    let row_v2 = -lever * (g * x + d * at.less_1);
    let k3 = vec4(a.low.z, -b.low.z, a.high.y + b.high.y, a.high.z + b.high.z);
    let k2 = vec4(a.low.y, -b.low.y, a.high.x + b.high.x, a.high.y + b.high.y);
    let by_0 = by_pressure(at, 0u);
    let by_1 = by_pressure(at, 1u);
    let by_2 = by_pressure(at, 2u);
    let by_3 = by_pressure(at, 3u);
    let dd = vec4(dot(by_0.sum, v), dot(by_1.sum, v), dot(by_2.sum, v), dot(by_3.sum, v));
    let c0 = -(dd.x * g + d * by_0.sum);
    let c1 = -(dd.y * g + d * by_1.sum);
    let c2 = -(dd.z * g + d * by_2.sum);
    let c3 = -(dd.w * g + d * by_3.sum);
    let row_q1 = lever * (dd * y + d * vec4(by_0.less.y, by_1.less.y, by_2.less.y, by_3.less.y)) - k3;
    let row_q2 = -lever * (dd * x + d * vec4(by_0.less.x, by_1.less.x, by_2.less.x, by_3.less.x)) + k2;
    let base = vec2(r.x / a.low.x, r.y / b.low.x);
    let slope_i = vec2(-a.low.y, -a.low.z) / a.low.x;
    let slope_ii = vec2(b.low.y, b.low.z) / b.low.x;
    let known = solve(slip, at.slip + c0 * base.x + c1 * base.y);
    let turned_1 = solve(slip, c2 + c0 * slope_i.x + c1 * slope_ii.x);
    let turned_2 = solve(slip, c3 + c0 * slope_i.y + c1 * slope_ii.y);
    let m11 = dot(row_v1, turned_1) + row_q1.z + row_q1.x * slope_i.x + row_q1.y * slope_ii.x;
    let m12 = dot(row_v1, turned_2) + row_q1.w + row_q1.x * slope_i.y + row_q1.y * slope_ii.y;
    let m21 = dot(row_v2, turned_1) + row_q2.z + row_q2.x * slope_i.x + row_q2.y * slope_ii.x;
    let m22 = dot(row_v2, turned_2) + row_q2.w + row_q2.x * slope_i.y + row_q2.y * slope_ii.y;
    let right_1 = -r.z - dot(row_v1, known) - row_q1.x * base.x - row_q1.y * base.y;
    let right_2 = -r.w - dot(row_v2, known) - row_q2.x * base.x - row_q2.y * base.y;
    let det = m11 * m22 - m12 * m21;
    let tilt = vec2(right_1 * m22 - m12 * right_2, m11 * right_2 - right_1 * m21) / det;
    let dv = known + turned_1 * tilt.x + turned_2 * tilt.y;
    let offset_i = base.x + slope_i.x * tilt.x + slope_i.y * tilt.y;
    let offset_ii = base.y + slope_ii.x * tilt.x + slope_ii.y * tilt.y;
    let back = -vec2(
        dd.z + dd.x * slope_i.x + dd.y * slope_ii.x,
        dd.w + dd.x * slope_i.y + dd.y * slope_ii.y,
    );
    let l1 = (back.x * m22 - back.y * m21) / det;
    let l2 = (back.y * m11 - back.x * m12) / det;
    let back_1 = solve(slip, row_v1);
    let back_2 = solve(slip, row_v2);
    let by_i = -(dd.x + l1 * (dot(c0, back_1) + row_q1.x) + l2 * (dot(c0, back_2) + row_q2.x));
    let by_ii = -(dd.y + l1 * (dot(c1, back_1) + row_q1.y) + l2 * (dot(c1, back_2) + row_q2.y));
    return Step(
        dv,
        vec4(offset_i, offset_ii, tilt),
        v / d - l1 * back_1 - l2 * back_2,
        vec4(by_i / a.low.x, by_ii / b.low.x, -l1, -l2),
    );
}

fn change(header: ContactHeader, at: Equations, step: Step) -> f32 {
    let radius = header.radius;
    let speed = sqrt(step.v.x * step.v.x + step.v.y * step.v.y) + abs(step.v.z) * radius;
    let here = sqrt(at.v.x * at.v.x + at.v.y * at.v.y) + abs(at.v.z) * radius;
    let tilt = sqrt(step.q.z * step.q.z + step.q.w * step.q.w) * radius;
    let pressure = header.area_i * (abs(step.q.x) + tilt) + header.area_ii * (abs(step.q.y) + tilt);
    let held = carried(at.moments_i, at.moments_ii, at.q);
    return (held.x + held.y) * speed + pressure * (here + speed);
}

fn rounding(at: Equations, load: LoadRecord, by: Step, error: f32) -> f32 {
    let force = at.friction_error.x;
    let moment = at.friction_error.y;
    let speed = abs(at.v);
    let d_error = (speed.x + speed.y) * force + speed.z * moment;
    let lever = abs(0.5 * load.distance * load.scale);
    let wrench = error / load.scale + ROUNDING;
    let slip = wrench + at.d * vec3(force, force, moment) + d_error * abs(at.g);
    let less = abs(at.difference.yx);
    let friction = lever * (d_error * less + at.d * (force + ROUNDING * less));
    let held = vec4(0.5 * error + at.pressure_error.xy, error + at.pressure_error.z + friction);
    return d_error + dot(abs(by.by_slip), slip) + dot(abs(by.by_held), held);
}

fn estimate(header: ContactHeader, load: LoadRecord, error: f32, twist: vec3<f32>) -> Estimate {
    let none = Estimate(twist, LARGEST, 0.0);
    var result = none;
    let ordinary = load.scale > LEAST_LOAD && load.scale <= RANGE && abs(load.f3) < MOST_PULL && abs(load.m1) <= RANGE && abs(load.m2) <= RANGE && load.distance < OUT_OF_RANGE && header.resolved != 0u;
    if !ordinary {
        return result;
    }
    var q = press(header, load);
    var v = twist;
    var step = Step(vec3(0.0), vec4(0.0), vec3(0.0), vec4(0.0));
    var at: Equations;
    var left = LARGEST;
    var share = 1.0;
    for (var k = 0u; k < CORRECTIONS; k++) {
        at.v = v + share * step.v;
        at.q = q + share * step.q;
        put(header, &at);
        if k == 0u {
            // To the minimum along the ray.
            let d = dot(at.g, at.v);
            let by = dot(load.wrench, at.v) / (d * d);
            at.v *= by;
            at.sum_1 /= by;
            at.sum_2 /= by;
            at.less_1 /= by;
            at.less_2 /= by;
        }
        residuals(&at, load);
        let size = sqrt(dot(at.slip, at.slip) + dot(at.held, at.held));
        let pressed = at.good && at.moments_i.low.x > 0.0 && at.moments_ii.low.x > 0.0 && at.d > 0.0;
        if !(pressed && size <= (1.0 - FALL * share) * left) {
            // Rounding is all that is left, or there is nothing to begin with.
            if k == 0u || left <= QUIET {
                break;
            }
            share *= SHORTER;
            result = none;
            continue;
        }
        let next = newton_step(at, load);
        let before = share * change(header, at, step);
        let after = change(header, at, next);
        v = at.v;
        q = at.q;
        left = size;
        step = next;
        share = 1.0;
        if k == 0u {
            continue;
        }
        let round_ = rounding(at, load, step, error);
        let contracts = after <= CONTRACTION * before;
        if contracts || (left <= QUIET && after <= round_) {
            result = none;
            let margin = WITHIN * after + round_;
            let upper = load.scale * (at.d + margin);
            let half_area = 0.5 * (header.area_i + header.area_ii);
            let weak = upper * upper * load.distance * load.distance <= half_area;
            let touches = at.moments_i.low.x >= HARDLY * header.area_i && at.moments_ii.low.x >= HARDLY * header.area_ii;
            if weak && touches && margin <= ESTIMATE_MARGIN * at.d {
                result = Estimate(v / sqrt(dot(v, v)), load.scale * (at.d - margin), upper);
            }
            if after <= SHARP * at.d {
                break;
            }
        } else if left > QUIET {
            result = none;
        }
    }
    return result;
}

// By its bits: what a comparison says of what is no number is the driver's choice.
fn is_positive(x: f32) -> bool {
    return bitcast<u32>(x) - 1u < INFINITE - 1u;
}

@compute @workgroup_size(GROUP)
fn newton(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let number = workgroup.x + GRID * workgroup.y;
    let last = arrayLength(&grips) - 1u;
    let grip = grips[min(number, last)];
    let header = contacts[grip.contact];
    let all = select(0u, grip.count, number <= last);
    if lane == 0u {
        atomicStore(&entries, 0u);
    }
    var floor = tally.outcomes[min(number, last)].floor;
    for (var begin = 0u; begin < all; begin += PART) {
        if lane == 0u {
            atomicStore(&gathered, 0u);
        }
        workgroupBarrier();
        let first_window = grip.wanted / MODES + begin / BITS;
        let windows = min(PART / BITS, (all - begin + BITS - 1u) / BITS);
        if lane < PART_WORDS {
            var word = 0u;
            if lane / 4u < windows {
                word = found[first_window + lane / 4u].words[lane % 4u];
            }
            atomicStore(&left_open[lane], word);
            if (grip.wanted & ESTIMATES) != 0u {
                var place = atomicAdd(&gathered, countOneBits(word));
                while word != 0u {
                    places[place] = 32u * lane + firstTrailingBit(word);
                    place++;
                    word &= word - 1u;
                }
            }
        }
        workgroupBarrier();
        if lane == 0u {
            count_open = atomicLoad(&gathered);
        }
        let count = workgroupUniformLoad(&count_open);
        for (var at = 0u; at < count; at += GROUP) {
            let slot = at + lane;
            let listed = cases[grip.first + begin + places[min(slot, count - 1u)]];
            let load = make_load(grip, listed);
            let p = planes(header, load);
            let best = search(header, load, p, lane);
            let seed = finish(header, load, p, best.twist, best.value);
            let estimated = estimate(header, load, load_error(grip, listed), seed.twist);
            if slot < count {
                let known = is_positive(estimated.lower) && is_positive(estimated.upper) && estimated.lower <= estimated.upper;
                if known {
                    floor = max(floor, estimated.lower * (1.0 - F32_TOLERANCE));
                }
                uppers[slot] = select(LARGEST, estimated.upper, known);
                slips[slot] = vec4(estimated.twist, estimated.lower);
            }
        }
        floors[lane] = floor;
        workgroupBarrier();
        for (var other = 0u; other < GROUP; other++) {
            floor = max(floor, floors[other]);
        }
        for (var slot = lane; slot < count; slot += GROUP) {
            let upper = uppers[slot];
            let place = places[slot];
            if upper < LARGEST {
                atomicAnd(&left_open[place / 32u], ~(1u << (place % 32u)));
                if (grip.wanted & EVERY) != 0u || upper * (1.0 + F32_TOLERANCE) >= floor {
                    append(FoundRecord(bitcast<vec4<u32>>(slips[slot]), upper, ESTIMATED, begin + place, number));
                }
            }
        }
        workgroupBarrier();
        if lane < windows {
            let words = vec4(
                atomicLoad(&left_open[4u * lane]),
                atomicLoad(&left_open[4u * lane + 1u]),
                atomicLoad(&left_open[4u * lane + 2u]),
                atomicLoad(&left_open[4u * lane + 3u]),
            );
            if any(words != vec4(0u)) {
                append(FoundRecord(words, 0.0, OPEN, begin + BITS * lane, number));
            }
        }
        workgroupBarrier();
    }
    if lane == 0u && number <= last {
        tally.outcomes[number] = OutcomeRecord(tally.outcomes[number].entries + atomicLoad(&entries), floor);
    }
}
