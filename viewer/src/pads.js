// The pads under one load: the pressure at every point of both faces, and the motion in which the part would slip.
// On plane faces the pressure is a plane. On others it is the stiffness times `delta - h + tilt`, where that is positive;
// the gap h of each piece is `c + g1 x1 + g2 x2 + (h11 x1^2 + 2 h12 x1 x2 + h22 x2^2) / 2`.

/** Whether a point lies within rings, holes left out. */
export function inside(rings, x, y) {
  let odd = false;
  for (const { points } of rings) {
    for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
      const [xi, yi] = points[i];
      const [xj, yj] = points[j];
      if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) odd = !odd;
    }
  }
  return odd;
}

export const gapAt = ([c, g1, g2, h11, h12, h22], x, y) => c + g1 * x + g2 * y + (h11 * x * x + 2 * h12 * x * y + h22 * y * y) / 2;

/** Largest value along a segment of a function that is quadratic on it. */
function largestOn(value, [ax, ay], [bx, by]) {
  const [start, middle, end] = [0, 0.5, 1].map((t) => value(ax + t * (bx - ax), ay + t * (by - ay)));
  const bend = 2 * (start + end - 2 * middle);
  const t = bend < 0 ? (3 * start + end - 4 * middle) / (2 * bend) : -1;
  return Math.max(start, end, t > 0 && t < 1 ? start - bend * t * t : -Infinity);
}

export class PadState {
  /** `pressure`, `slip`: the records of the data (see `Report.state`). */
  constructor(report, i, pressure, slip) {
    this.report = report;
    this.grip = i;
    this.record = pressure;
    this.pieces = report.pieces(i);
    this.slip = report.slipOf(slip);
    this.known = Number.isFinite(pressure[0]);
  }

  /** Pressure plane of a face as `[value at the origin, slope x1, slope x2]`; null on other faces, or where nothing is known. */
  plane(face) {
    if (!this.known || this.pieces) return null;
    const [aI0, aII0, a1, a2] = this.record;
    return face ? [aII0, -a1, -a2] : [aI0, a1, a2];
  }

  /** Pieces of a face: of plane faces the contact area. */
  of(face) {
    this.areas ??= this.pieces ?? [0, 1].map((side) => ({ face: side, gap: null, rings: this.report.contact(this.grip).filter((ring) => ring.face === side) }));
    return this.areas.filter((piece) => piece.face === face);
  }

  /** Pressure on a piece at a point [Pa], negative where the pad is off. */
  on(piece, x, y) {
    if (!this.pieces) {
      const [a0, a1, a2] = this.plane(piece.face);
      return a0 + a1 * x + a2 * y;
    }
    const stiffness = this.report.column.surface_stiffness[2 * this.report.column.surface[this.grip] + piece.face];
    const [deltaI, deltaII, a1, a2] = this.record;
    const tilt = a1 * x + a2 * y;
    return stiffness * (piece.face ? deltaII - tilt - gapAt(piece.gap, x, y) : deltaI + tilt - gapAt(piece.gap, x, y));
  }

  /** Pressure on a face at a point [Pa]: NaN where nothing is known or no face is. */
  at(face, x, y) {
    if (!this.known) return NaN;
    const piece = this.of(face).find(({ rings }) => inside(rings, x, y));
    return piece ? Math.max(0, this.on(piece, x, y)) : NaN;
  }

  /** Largest pressure on a face [Pa]. */
  largest(face) {
    if (!this.known) return NaN;
    let most = 0;
    for (const piece of this.of(face)) {
      const value = (x, y) => this.on(piece, x, y);
      for (const { points } of piece.rings) points.forEach((from, k) => (most = Math.max(most, largestOn(value, from, points[(k + 1) % points.length]))));
      // The top of the pressure within the piece.
      if (!piece.gap) continue;
      const [, g1, g2, h11, h12, h22] = piece.gap;
      const sign = piece.face ? -1 : 1;
      const [r1, r2] = [sign * this.record[2] - g1, sign * this.record[3] - g2];
      const det = h11 * h22 - h12 * h12;
      if (!(det > 1e-12 * (h11 + h22) ** 2)) continue;
      const top = [(h22 * r1 - h12 * r2) / det, (h11 * r2 - h12 * r1) / det];
      if (inside(piece.rings, ...top)) most = Math.max(most, value(...top));
    }
    return most;
  }

  /** Direction of the friction on the part at a point of a face, or null where nothing slips. */
  friction(face, x, y) {
    const { slip } = this;
    if (slip.type === 'translation') return slip.direction.map((v) => -v);
    let motion = null;
    if (slip.type === 'rotation') motion = [-slip.sense * (y - slip.c[1]), slip.sense * (x - slip.c[0])];
    if (slip.type === 'spin' && slip.rolls !== (face ? 'II' : 'I')) {
      const [o1, o2, o3] = slip.omega;
      const width = this.report.column.width[this.grip];
      const z = (face ? -0.5 : 0.5) * (this.report.column.inside[this.grip] ? -width : width);
      motion = [slip.velocity[0] - o3 * y + o2 * z, slip.velocity[1] + o3 * x - o1 * z];
    }
    const speed = motion ? Math.hypot(...motion) : 0;
    return speed > 0 ? motion.map((v) => -v / speed) : null;
  }
}
