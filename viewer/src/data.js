// The embedded result: a JSON header and one compressed block of binary columns. Nothing is fetched.

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
    /** Friction of the pads that the run reckoned with, where one is known. */
    this.friction = header.asked.pad_friction ?? header.gripper?.pad_friction ?? null;
    this.rowOf = new Map(Array.from(column.by_load_grip, (grip, row) => [grip, row]));
    this.indexOfId = new Map(Array.from(column.id, (id, i) => [id, i]));
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

  /** Pressure planes `[p_I, p_II]` as `[value at the origin, slope x1, slope x2]`, or null. */
  pressure(i) {
    const [aI0, aII0, a1, a2] = this.column.pressure.subarray(4 * i, 4 * i + 4);
    return Number.isFinite(aI0) ? [[aI0, a1, a2], [aII0, -a1, -a2]] : null;
  }

  slip(i) {
    const [kind, a, b, sense] = this.column.slip.subarray(4 * i, 4 * i + 4);
    if (kind === 1) return { type: 'rotation', c: [a, b], sense };
    if (kind === 2) return { type: 'translation', direction: [a, b] };
    return { type: kind === 3 ? 'none' : 'unknown' };
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
