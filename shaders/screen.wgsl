// Which loads of each grip can be its worst: twin of src/backend/gpu/twin.rs, same functions in the same order; there is
// said what they compute. One workgroup takes a grip, or a part of its loads, and walks over them; only the loads whose
// upper bound reaches the best lower one come back.

@group(0) @binding(4) var<storage, read> cases: array<CaseRecord>;
@group(0) @binding(5) var<storage, read> grips: array<GripRecord>;
@group(0) @binding(6) var<storage, read_write> tally: Tally;
@group(0) @binding(7) var<storage, read_write> found: array<FoundRecord>;

struct Tally {
    // Of all grips; more than there is room for in `found` are counted, not written.
    entries: atomic<u32>,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
    outcomes: array<OutcomeRecord>,
}

// Of the loads of a window: what their mu_s is at most, their best twists and the values there.
var<workgroup> ceilings: array<f32, WINDOW>;
var<workgroup> bests: array<u32, WINDOW>;
var<workgroup> values: array<f32, WINDOW>;
// A bit for each of them that has no bounds.
var<workgroup> open: array<atomic<u32>, WORDS>;
var<workgroup> floors: array<f32, GROUP>;
var<workgroup> entries: atomic<u32>;

fn make_load(grip: GripRecord, listed: CaseRecord) -> LoadRecord {
    let on_part = grip.force * listed.force;
    let about = grip.moment * listed.moment + cross(grip.lever, on_part);
    let force = vec3(dot(grip.row_1, on_part), dot(grip.row_2, on_part), dot(grip.row_3, on_part));
    let moment = vec3(dot(grip.row_1, about), dot(grip.row_2, about), dot(grip.row_3, about));
    let in_plane = vec3(force.xy, moment.z);
    let size = max(sqrt(dot(in_plane, in_plane)), LEAST_LOAD);
    return LoadRecord(in_plane / size, size, force.z, moment.x, moment.y, grip.distance);
}

fn load_error(grip: GripRecord, listed: CaseRecord) -> f32 {
    let size = grip.force * listed.force_size * (1.0 + grip.arm) + grip.moment * listed.moment_size;
    return LOAD_ROUNDING * size + LEAST_LOAD;
}

fn least_pressure(header: ContactHeader, p: Planes) -> f32 {
    var least = LARGEST;
    for (var i = header.edges_i; i < header.edges_ii; i++) {
        least = min(least, header.area_i * (p.at_i + p.slope.x * edges[i].x + p.slope.y * edges[i].y));
    }
    for (var i = header.edges_ii; i < header.edges_end; i++) {
        least = min(least, header.area_ii * (p.at_ii - (p.slope.x * edges[i].x + p.slope.y * edges[i].y)));
    }
    return least;
}

fn doubt(header: ContactHeader, load: LoadRecord, p: Planes, error: f32, upper: f32) -> f32 {
    let ordinary = load.scale > LEAST_LOAD && load.scale <= RANGE && abs(load.f3) < MOST_PULL && abs(load.m1) <= RANGE && abs(load.m2) <= RANGE;
    if !ordinary {
        return LARGEST;
    }
    var share = LARGEST;
    if header.faces == 1u {
        let coupling = 1.0 + abs(load.distance) * load.scale * upper;
        let sway = error * (0.5 + 4.0 * header.tilt * coupling);
        if sway <= SWAY_CONGRUENT {
            share = error / load.scale * (header.quickest / header.slowest);
        }
    } else {
        let sway = error * (0.5 + header.tilt);
        let least = least_pressure(header, p);
        if sway <= SWAY_DIFFERENT && 4.0 * sway <= least {
            share = 2.0 * error / load.scale * (header.quickest / (least * header.slowest)) + 4.0 * sway / least;
        }
    }
    return select(LARGEST, share, share <= RANGE);
}

// The seed of a load, its bounds those of its mu_s and widened by the rounding of the load; UNBOUNDED where that is not
// known to be small.
struct Judged {
    seed: SeedRecord,
    doubt: f32,
}

fn judge(header: ContactHeader, load: LoadRecord, p: Planes, error: f32, best: Best) -> Judged {
    var seed = finish(header, load, p, best.twist, best.value);
    var share = LARGEST;
    if seed.status != UNBOUNDED {
        share = doubt(header, load, p, error, seed.upper);
    }
    if share < LARGEST {
        seed.lower = load.scale * seed.lower * max(1.0 - share, 0.0);
        seed.upper = load.scale * seed.upper * (1.0 + share);
    } else {
        seed.status = UNBOUNDED;
    }
    return Judged(seed, share);
}

// Entries lie behind the windows of all grips.
fn append(entry: FoundRecord) {
    let last = grips[arrayLength(&grips) - 1u];
    let windows = last.wanted / MODES + (last.count + BITS - 1u) / BITS;
    let place = windows + atomicAdd(&tally.entries, 1u);
    atomicAdd(&entries, 1u);
    if place < arrayLength(&found) {
        found[place] = entry;
    }
}

@compute @workgroup_size(GROUP)
fn screen(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let number = workgroup.x + GRID * workgroup.y;
    let last = arrayLength(&grips) - 1u;
    let grip = grips[min(number, last)];
    let header = contacts[grip.contact];
    // Workgroups beyond the last have nothing to do.
    let all = select(0u, grip.count, number <= last);
    if lane == 0u {
        atomicStore(&entries, 0u);
    }
    var floor = 0.0;
    for (var first = 0u; first < all; first += WINDOW) {
        let count = min(WINDOW, all - first);
        if lane < WORDS {
            atomicStore(&open[lane], 0u);
        }
        for (var at = 0u; at < count; at += GROUP) {
            let slot = at + lane;
            let listed = cases[grip.first + first + min(slot, count - 1u)];
            let load = make_load(grip, listed);
            let p = planes(header, load);
            let best = search(header, load, p, lane);
            let judged = judge(header, load, p, load_error(grip, listed), best);
            if slot < count {
                var ceiling = LARGEST;
                if judged.doubt < LARGEST {
                    ceiling = judged.seed.upper * (1.0 + F32_TOLERANCE);
                    floor = max(floor, judged.seed.lower * (1.0 - F32_TOLERANCE));
                }
                ceilings[slot] = ceiling;
                bests[slot] = best.twist;
                values[slot] = best.value;
            }
        }
        floors[lane] = floor;
        workgroupBarrier();
        for (var other = 0u; other < GROUP; other++) {
            floor = max(floor, floors[other]);
        }
        // Only these loads are written: their seeds are made again, which costs less than keeping all.
        for (var slot = lane; slot < count; slot += GROUP) {
            if (grip.wanted & EVERY) == 0u && ceilings[slot] < floor {
                continue;
            }
            let listed = cases[grip.first + first + slot];
            let load = make_load(grip, listed);
            let p = planes(header, load);
            let judged = judge(header, load, p, load_error(grip, listed), Best(bests[slot], values[slot]));
            if judged.doubt <= LOAD_MARGIN {
                let seed = judged.seed;
                let words = bitcast<vec4<u32>>(vec4(seed.twist, seed.lower));
                append(FoundRecord(words, seed.upper, seed.status + KINDS * seed.best, first + slot, number));
            } else {
                atomicOr(&open[slot / 32u], 1u << (slot % 32u));
            }
        }
        workgroupBarrier();
        // What is left open is for Newton's method.
        if lane < (count + BITS - 1u) / BITS {
            let words = vec4(
                atomicLoad(&open[4u * lane]),
                atomicLoad(&open[4u * lane + 1u]),
                atomicLoad(&open[4u * lane + 2u]),
                atomicLoad(&open[4u * lane + 3u]),
            );
            let window = grip.wanted / MODES + first / BITS + lane;
            found[window] = FoundRecord(words, 0.0, OPEN, first + BITS * lane, number);
        }
        workgroupBarrier();
    }
    if lane == 0u && number <= last {
        tally.outcomes[number] = OutcomeRecord(atomicLoad(&entries) + 1u, floor);
    }
}
