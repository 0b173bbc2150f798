// The embedded result: a JSON header and one compressed block of binary columns. Nothing is fetched.

import { inMm, number } from './format.js';
import { PadState } from './pads.js';

const KINDS = { u8: Uint8Array, i8: Int8Array, u16: Uint16Array, u32: Uint32Array, f32: Float32Array, f64: Float64Array, delta: Int32Array };

function fromBase64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text.trim());
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

/** Running sums, in place: the indices behind stored differences. */
function undoDifferences(differences) {
  let sum = 0;
  for (let i = 0; i < differences.length; i++) {
    sum = (sum + differences[i]) | 0;
    differences[i] = sum;
  }
  return new Uint32Array(differences.buffer, differences.byteOffset, differences.length);
}

/** Reads the page's data. `n` grips; `column.mu[i]` and so on; vectors lie one after another. */
export async function load(document) {
  if (typeof DecompressionStream === 'undefined') throw new Error('this browser is too old to unpack the page (it lacks DecompressionStream)');
  const header = JSON.parse(document.getElementById('report-header').textContent);
  const element = document.getElementById('report-data');
  const packed = new Blob([fromBase64(element.textContent)]);
  element.remove();
  const buffer = await new Response(packed.stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
  const column = {};
  for (const [name, [kind, offset, length]] of Object.entries(header.sections)) {
    const values = new KINDS[kind](buffer, offset, length);
    column[name] = kind === 'delta' ? undoDifferences(values) : values;
  }
  return new Report(header, column);
}

export class Report {
  constructor(header, column) {
    this.header = header;
    this.column = column;
    this.n = header.grips.shown;
    /** What the run reckoned with; a friction that nobody stated is null. */
    this.planned = { friction: header.asked.pad_friction ?? null, force: header.asked.force ?? null, safety: header.asked.safety ?? 1 };
    /** What is shown: as planned, until somebody asks what if. */
    this.now = { ...this.planned };
    this.known = new Map();
    this.surfaces = new Map();
    // Pieces of surface are counted over all surfaces.
    this.pieceOf = new Uint32Array(column.surface_ring_kind.length);
    let pieces = 0;
    column.surface_ring_kind.forEach((kind, ring) => (this.pieceOf[ring] = kind & 4 ? pieces++ : pieces - 1));
    this.misses = column.miss_id.length;
    this.rowOf = new Map(Array.from(column.by_load_grip, (grip, row) => [grip, row]));
    /** How many of the grips are one turned about the axis of a round part, by the id of the best of them. */
    this.turns = new Map();
    column.turn_of?.forEach((id) => this.turns.set(id, (this.turns.get(id) ?? 0) + 1));
    this.indexOfId = new Map(Array.from(column.id, (id, i) => [id, i]));
  }

  /** Friction of the pads that is shown, or null. */
  get friction() {
    return this.now.friction;
  }

  /** Whether something else than the plan is shown. */
  get changed() {
    return Object.keys(this.now).some((name) => this.now[name] !== this.planned[name]);
  }

  /** Whether the friction needed is only an estimate: at another force, in proportion to load over force. */
  get estimate() {
    return this.now.force !== this.planned.force;
  }

  /** Friction needed by grip `i` (NaN: no limit state). */
  mu(i) {
    return this.scaled(this.column.mu[i]);
  }

  scaled(mu) {
    return this.estimate ? (mu * this.planned.force) / this.now.force : mu;
  }

  /** Friction of the pads over the friction needed (NaN without either). */
  safety(i) {
    if (!this.changed && Number.isFinite(this.column.safety[i])) return this.column.safety[i];
    return this.friction ? this.friction / this.mu(i) : NaN;
  }

  /** Whether the pads hold grip `i` with the safety asked for; null where no friction is known. */
  holds(i) {
    // As planned the program has decided, to all its digits.
    if (!this.changed) return [null, true, false][this.column.verdict[i]];
    if (!this.friction) return null;
    return this.column.mu[i] === 0 || this.safety(i) >= this.now.safety * (1 - 1e-6);
  }

  /** Whether `squeeze` is only an estimate: another friction or safety than planned. */
  get squeezeEstimate() {
    return this.friction !== this.planned.friction || this.now.safety !== this.planned.safety;
  }

  /** Gripping force of one jaw [N] that grip `i` needs under its worst load. */
  squeeze(i) {
    const planned = this.column.force_needed[i];
    return this.squeezeEstimate ? (planned * this.planned.friction * this.now.safety) / (this.friction * this.planned.safety) : planned;
  }

  /** Where that force lies in what the gripper has: `above`, `below`, `within`, or nothing where that is not known. */
  forceRange(i) {
    const [least, most] = this.header.gripper?.force ?? [];
    const needed = this.squeeze(i);
    if (!Number.isFinite(needed) || most === undefined) return '';
    return needed > most * (1 + 1e-6) ? 'above' : needed < least * (1 - 1e-6) ? 'below' : 'within';
  }

  /** Quality as the program exports it: `m/(1 + m)` of the margin `m`, pads of unknown friction taken for 1. */
  quality(i) {
    const mu = this.column.mu[i];
    return Number.isFinite(mu) ? 1 / (1 + (mu * this.planned.safety) / (this.planned.friction ?? 1)) : 0;
  }

  /** Score by which grips are ranked, at the force shown. */
  score(i) {
    const { k1, k2 } = this.header.asked;
    return (k1 ?? 1) / this.mu(i) + (k2 ?? 1) * this.column.alpha[i];
  }

  /** Share of the pad that touches, on the face where it is less (NaN without a gripper). */
  cover(i) {
    const key = this.column.contact[i];
    if (!this.known.has(key)) {
      const area = (points) => points.reduce((sum, [x, y], k) => sum + (x * points[(k + 1) % points.length][1] - y * points[(k + 1) % points.length][0]) / 2, 0);
      const pad = Math.abs(area(this.header.gripper?.pad ?? []));
      const touching = [0, 0];
      for (const ring of this.contact(i)) touching[ring.face] += (ring.hole ? -1 : 1) * Math.abs(area(ring.points));
      this.known.set(key, pad > 0 ? Math.min(...touching) / pad : NaN);
    }
    return this.known.get(key);
  }

  /** Largest pressure under the worst load of grip `i` [Pa]. */
  largestPressure(i) {
    const state = this.state(i);
    return state.known ? Math.max(state.largest(0), state.largest(1)) : NaN;
  }

  status(i) {
    return this.header.statuses[this.column.status[i]];
  }

  load(i) {
    return this.header.loads[this.column.load[i]];
  }

  /** Rotation columns (x1, x2, x3) and origin of grip `i` in the part frame. */
  pose(i) {
    const r = this.column.rotation.subarray(9 * i, 9 * i + 9);
    const axis = (k) => [r[3 * k], r[3 * k + 1], r[3 * k + 2]];
    return { x1: axis(0), x2: axis(1), x3: axis(2), origin: Array.from(this.column.origin.subarray(3 * i, 3 * i + 3)) };
  }

  /** Contact rings of grip `i`: `{ face: 0 | 1, hole, points: [[x1, x2], ...] }`. */
  contact(i) {
    const { contact, contact_rings: rings, ring_points: starts, ring_kind: kinds, points } = this.column;
    const list = [];
    for (let ring = rings[contact[i]]; ring < rings[contact[i] + 1]; ring++) {
      const ends = [];
      for (let k = starts[ring]; k < starts[ring + 1]; k++) ends.push([points[2 * k], points[2 * k + 1]]);
      list.push({ face: kinds[ring] & 1, hole: (kinds[ring] & 2) !== 0, points: ends });
    }
    return list;
  }

  /** Pieces of surface under the pads of grip `i`, or null where all is plane: `{ face, gap, rings }`, see `PadState`. */
  pieces(i) {
    const { surface, surface_rings: first, surface_ring_points: starts, surface_ring_kind: kinds, surface_points: points, surface_gap: gaps } = this.column;
    const own = surface[i];
    if (own === 0xffffffff) return null;
    if (!this.surfaces.has(own)) {
      const list = [];
      for (let ring = first[own]; ring < first[own + 1]; ring++) {
        if (kinds[ring] & 4) list.push({ face: kinds[ring] & 1, gap: gaps.subarray(6 * this.pieceOf[ring], 6 * this.pieceOf[ring] + 6), rings: [] });
        const ends = [];
        for (let k = starts[ring]; k < starts[ring + 1]; k++) ends.push([points[2 * k], points[2 * k + 1]]);
        list.at(-1).rings.push({ face: kinds[ring] & 1, hole: (kinds[ring] & 2) !== 0, points: ends });
      }
      this.surfaces.set(own, list);
    }
    return this.surfaces.get(own);
  }

  /** What the pads of grip `i` do under load `load`; null where that was not stored. */
  state(i, load = this.column.load[i]) {
    const c = this.column;
    if (load === c.load[i]) return new PadState(this, i, c.pressure.subarray(4 * i, 4 * i + 4), c.slip.subarray(7 * i, 7 * i + 7));
    const row = this.rowOf.get(i);
    if (row === undefined) return null;
    const k = c.state_load.subarray(c.state_rows[row], c.state_rows[row + 1]).indexOf(load);
    if (k < 0) return null;
    const at = c.state_rows[row] + k;
    return new PadState(this, i, c.state_pressure.subarray(4 * at, 4 * at + 4), c.state_slip.subarray(7 * at, 7 * at + 7));
  }

  /** What is pressed of a face that is not plane under the worst load, in words; null of others. */
  pressedArea(i, face) {
    const area = this.column.face_area[2 * i + face];
    if (!Number.isFinite(area)) return null;
    const [along, across] = this.column.face_size.subarray(4 * i + 2 * face, 4 * i + 2 * face + 2);
    return `${number(area * 1e6)}\u00a0mm\u00b2 in ${inMm(along)} \u00d7 ${inMm(across)}\u00a0mm`;
  }

  /** What to know beside the numbers of grip `i`. */
  notes(i) {
    const { note, note_rows: rows } = this.column;
    return Array.from(note.subarray(rows[i], rows[i + 1]), (k) => this.header.notes[k]);
  }

  /** Incipient motion of grip `i` under its worst load. */
  slip(i) {
    return this.slipOf(this.column.slip.subarray(7 * i, 7 * i + 7));
  }

  /** A slip record of the data as an object. */
  slipOf([kind, a, b, c, u1, u2, rolls]) {
    if (kind === 1) return { type: 'rotation', c: [a, b], sense: c };
    if (kind === 2) return { type: 'translation', direction: [a, b] };
    if (kind === 4) return { type: 'spin', omega: [a, b, c], velocity: [u1, u2], rolls: ['', 'I', 'II'][rolls] };
    return { type: kind === 3 ? 'none' : 'unknown' };
  }

  /** Rejected candidate `k`. */
  miss(k) {
    const c = this.column;
    const r = c.miss_rotation.subarray(9 * k, 9 * k + 9);
    const axis = (n) => [r[3 * n], r[3 * n + 1], r[3 * n + 2]];
    const place = Array.from(c.miss_place.subarray(3 * k, 3 * k + 3));
    return {
      reason: this.header.reasons[c.miss_reason[k]], id: c.miss_id[k], x1: axis(0), x2: axis(1), x3: axis(2), origin: Array.from(c.miss_origin.subarray(3 * k, 3 * k + 3)),
      width: c.miss_width[k], inside: c.miss_inside[k] === 1, faces: Array.from(c.miss_faces.subarray(2 * k, 2 * k + 2)), by: c.miss_by[k], place: place.every(Number.isFinite) ? place : null,
      palm: [c.miss_palm[2 * k], c.miss_palm[2 * k + 1]],
    };
  }

  /** Of every reason the rejected candidate that lacks least, by the reason's name. */
  nearestMisses() {
    const best = new Map();
    for (let k = 0; k < this.misses; k++) {
      const by = this.column.miss_by[k];
      const name = this.header.reasons[this.column.miss_reason[k]];
      const known = best.get(name);
      // Where no number says what is lacking, another one tells more.
      if (known === undefined || by < this.column.miss_by[known] || (Number.isNaN(this.column.miss_by[known]) && by >= 0)) best.set(name, k);
    }
    return best;
  }

  /** Loads of grip `i`, the one that needs most friction first; the worst one alone where no others are stored. */
  hardestFirst(i) {
    const values = this.byLoad(i);
    const worst = this.column.load[i];
    if (!values) return [worst];
    const rank = (load) => (Number.isFinite(values[load]) ? values[load] : Infinity);
    return [...values.keys()].sort((a, b) => (rank(b) === rank(a) ? (a === worst ? -1 : b === worst ? 1 : a - b) : rank(b) - rank(a)));
  }

  /** mu_s of every load for grip `i` (NaN: no limit state), or null where the table was not stored. */
  byLoad(i) {
    const { low, high } = this.header.by_load;
    const row = this.rowOf.get(i);
    if (row === undefined) return null;
    const n = this.header.loads.length;
    const factor = Math.log(high / low) / 65533;
    const values = Float64Array.from(this.column.by_load.subarray(row * n, (row + 1) * n), (code) => (code === 0 ? NaN : code === 1 ? 0 : low * Math.exp((code - 2) * factor)));
    // The worst one is known to all its digits.
    values[this.column.load[i]] = this.column.mu[i];
    return values;
  }
}
