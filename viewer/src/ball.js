// mu_s over the directions of the load force, as a ball that turns with the three-dimensional view: a point of the
// ball is the direction in which a load pushes the part, coloured by the friction that it needs.

import { NO_LIMIT, friction } from './colour.js';

/** Cells along each axis of the direction map. */
const GRID = 24;
/** Fewer directions than this do not cover the ball: they are drawn as discs. */
const SPARSE = 20;

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Octahedral map: unit vector to [0, 1]^2. */
function fold([x, y, z]) {
  const sum = Math.abs(x) + Math.abs(y) + Math.abs(z);
  let [u, v] = [x / sum, y / sum];
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)];
  return [(u + 1) / 2, (v + 1) / 2];
}

function unfold(u, v) {
  let [x, y] = [2 * u - 1, 2 * v - 1];
  const z = 1 - Math.abs(x) - Math.abs(y);
  if (z < 0) [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}

export class LoadBall {
  constructor(canvas, report, view) {
    this.canvas = canvas;
    this.report = report;
    this.view = view;
    this.group();
    this.sparse = this.directions.length < SPARSE;
    if (!this.sparse) this.index();
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.down = [event.clientX, event.clientY];
      this.drag = [event.clientX, event.clientY];
    });
    canvas.addEventListener('pointermove', (event) => {
      if (this.drag && this.view) {
        this.view.orbit(-(event.clientX - this.drag[0]) * 0.012, -(event.clientY - this.drag[1]) * 0.012);
        this.drag = [event.clientX, event.clientY];
      }
      this.hover?.(this.under(event));
    });
    canvas.addEventListener('pointerup', (event) => {
      this.drag = null;
      const still = this.down && Math.hypot(event.clientX - this.down[0], event.clientY - this.down[1]) < 4;
      const hit = still && this.under(event);
      if (hit) this.onPick?.(hit.load);
    });
    // From the hardest load to the easiest, and back.
    canvas.addEventListener('keydown', (event) => {
      const step = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 }[event.key];
      if (!step || !this.mu) return;
      event.preventDefault();
      const order = this.report.hardestFirst(this.grip);
      const from = order.indexOf(this.picked >= 0 ? this.picked : this.report.column.load[this.grip]);
      this.onPick?.(order[Math.min(Math.max(from + step, 0), order.length - 1)]);
    });
    canvas.addEventListener('pointercancel', () => (this.drag = null));
    canvas.addEventListener('pointerleave', () => this.hover?.(null));
  }

  /** Loads with the same force direction (differing in moment, say) share a place; the worst of them is shown. */
  group() {
    const known = new Map();
    this.directions = [];
    this.members = [];
    this.report.header.loads.forEach((load, i) => {
      const force = load.wrench.force;
      const length = Math.hypot(...force);
      if (!(length > 0)) return;
      const d = force.map((v) => v / length);
      const key = d.map((v) => Math.round(v * 1e6) + 0).join();
      if (!known.has(key)) {
        known.set(key, this.directions.length);
        this.directions.push(d);
        this.members.push([]);
      }
      this.members[known.get(key)].push(i);
    });
  }

  /** For each cell of the direction map, the directions that can be nearest to a point in it. */
  index() {
    this.cells = [];
    for (let row = 0; row < GRID; row++) {
      for (let column = 0; column < GRID; column++) {
        const middle = unfold((column + 0.5) / GRID, (row + 0.5) / GRID);
        let radius = 0;
        for (const [du, dv] of [[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0, 0.5], [1, 0.5], [0.5, 1]]) {
          radius = Math.max(radius, Math.acos(Math.min(1, dot(middle, unfold((column + du) / GRID, (row + dv) / GRID)))));
        }
        const angles = this.directions.map((d) => Math.acos(Math.min(1, Math.max(-1, dot(d, middle)))));
        const reach = Math.min(...angles) + 2.1 * radius;
        this.cells.push(angles.flatMap((angle, i) => (angle <= reach ? [i] : [])));
      }
    }
  }

  nearest(d) {
    const [u, v] = fold(d);
    const cell = this.cells[Math.min(GRID - 1, Math.floor(v * GRID)) * GRID + Math.min(GRID - 1, Math.floor(u * GRID))];
    let [best, found] = [-2, -1];
    for (const i of cell) {
      const closeness = dot(this.directions[i], d);
      if (closeness > best) [best, found] = [closeness, i];
    }
    return found;
  }

  /** Takes grip `i`'s table; answers with `{ low, high, missing }` over the loads, or null without a table. */
  setGrip(i) {
    this.grip = i;
    this.picked = -1;
    this.mu = this.report.byLoad(i);
    this.worst = this.members.findIndex((list) => list.includes(this.report.column.load[i]));
    this.values = this.mu && this.members.map((list) => list.reduce((most, load) => (Number.isNaN(most) || Number.isNaN(this.mu[load]) ? NaN : Math.max(most, this.mu[load])), 0));
    const finite = (this.mu ?? []).filter?.(Number.isFinite) ?? [];
    this.range = finite.length ? { low: Math.min(...finite), high: Math.max(...finite), missing: this.mu.length - finite.length } : null;
    this.paints = this.values?.map((mu) => this.paint(mu));
    this.draw();
    return this.range;
  }

  /** Marks load `load` (-1: none). */
  pick(load) {
    this.picked = load;
    this.draw();
  }

  paint(mu) {
    if (!Number.isFinite(mu) || !this.range) return NO_LIMIT;
    const { low, high } = this.range;
    return friction(high > low ? (mu - low) / (high - low) : 0);
  }

  geometry() {
    const size = this.canvas.clientWidth;
    return { size, middle: size / 2, radius: size / 2 - 20 };
  }

  /** The load under the pointer. */
  under(event) {
    const rect = this.canvas.getBoundingClientRect();
    const { middle, radius } = this.geometry();
    const [x, y] = [(event.clientX - rect.left - middle) / radius, -(event.clientY - rect.top - middle) / radius];
    const z2 = 1 - x * x - y * y;
    if (z2 < 0 || !this.values || this.directions.length === 0) return null;
    const [right, up, out] = this.axes();
    const z = Math.sqrt(z2);
    const d = [0, 1, 2].map((k) => right[k] * x + up[k] * y + out[k] * z);
    let found = this.sparse ? -1 : this.nearest(d);
    if (this.sparse) found = this.directions.findIndex((direction) => dot(direction, d) > 0.97);
    if (found < 0) return null;
    const worst = this.members[found].reduce((a, b) => (Number.isNaN(this.mu[a]) || this.mu[a] >= this.mu[b] ? a : b));
    return { load: worst, mu: this.mu[worst] };
  }

  axes() {
    return this.view?.axes() ?? [[0.8, 0.6, 0], [-0.3, 0.4, 0.866], [0.52, -0.69, 0.5]];
  }

  draw() {
    const { size, middle, radius } = this.geometry();
    if (!size || this.grip === undefined) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const pixels = Math.round(size * ratio);
    if (this.canvas.width !== pixels) this.canvas.width = this.canvas.height = pixels;
    const context = this.canvas.getContext('2d');
    const style = getComputedStyle(this.canvas);
    const ink = style.color;
    const axes = this.axes();
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, pixels, pixels);
    if (this.values && !this.sparse) this.cover(context, pixels, ratio, radius, axes);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!this.values || this.sparse) {
      const shade = context.createRadialGradient(middle - radius * 0.35, middle - radius * 0.4, radius * 0.1, middle, middle, radius);
      shade.addColorStop(0, style.getPropertyValue('--ball-light'));
      shade.addColorStop(1, style.getPropertyValue('--ball-dark'));
      context.fillStyle = shade;
      context.beginPath();
      context.arc(middle, middle, radius, 0, 2 * Math.PI);
      context.fill();
    }
    const project = (d) => [middle + dot(axes[0], d) * radius, middle - dot(axes[1], d) * radius, dot(axes[2], d)];
    this.drawAxes(context, project, middle, radius, ink, style.getPropertyValue('--panel'));
    if (this.values && this.sparse) {
      const order = this.directions.map((d, i) => [i, ...project(d)]).sort((a, b) => a[3] - b[3]);
      for (const [i, x, y, z] of order) {
        context.globalAlpha = z < 0 ? 0.3 : 1;
        context.fillStyle = `rgb(${this.paints[i].map(Math.round).join(' ')})`;
        context.beginPath();
        context.arc(x, y, radius * 0.13, 0, 2 * Math.PI);
        context.fill();
      }
      context.globalAlpha = 1;
    }
    const at = this.members.findIndex((list) => list.includes(this.picked));
    if (at >= 0) this.drawPicked(context, ...project(this.directions[at]));
    if (this.worst >= 0) this.drawWorst(context, ...project(this.directions[this.worst]), middle, radius);
  }

  cover(context, pixels, ratio, radius, [right, up, out]) {
    const image = context.createImageData(pixels, pixels);
    const reach = radius * ratio;
    const middle = pixels / 2;
    const d = [0, 0, 0];
    for (let row = 0; row < pixels; row++) {
      const y = (middle - row - 0.5) / reach;
      for (let column = 0; column < pixels; column++) {
        const x = (column + 0.5 - middle) / reach;
        const z2 = 1 - x * x - y * y;
        const edge = (1 - Math.sqrt(x * x + y * y)) * reach + 0.5;
        if (edge <= 0) continue;
        const z = Math.sqrt(Math.max(z2, 0));
        for (let k = 0; k < 3; k++) d[k] = right[k] * x + up[k] * y + out[k] * z;
        const paint = this.paints[this.nearest(d)];
        // A light from the upper left gives the ball its shape without hiding the colours.
        const light = 0.8 + 0.2 * Math.max(0, -0.35 * x + 0.45 * y + 0.82 * z);
        const at = 4 * (row * pixels + column);
        for (let k = 0; k < 3; k++) image.data[at + k] = paint[k] * light;
        image.data[at + 3] = 255 * Math.min(1, edge);
      }
    }
    context.putImageData(image, 0, 0);
  }

  drawAxes(context, project, middle, radius, ink, halo) {
    this.labels = [];
    context.font = '600 11px system-ui, sans-serif';
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.strokeStyle = context.fillStyle = ink;
    for (const [name, d] of [['x', [1, 0, 0]], ['y', [0, 1, 0]], ['z', [0, 0, 1]]]) {
      const [x, y, z] = project(d);
      const [dx, dy] = [x - middle, y - middle];
      context.globalAlpha = z < -0.2 ? 0.35 : 0.95;
      context.lineWidth = 1.3;
      context.beginPath();
      context.moveTo(x - dx * 0.06, y - dy * 0.06);
      context.lineTo(x + dx * 0.04, y + dy * 0.04);
      context.stroke();
      const length = Math.hypot(dx, dy);
      // Beside the ball a letter is readable on every colour; one that points at the viewer gets a halo.
      const out = Math.max(length * 1.04 + 9, z < 0 || length > 0.8 * radius ? radius + 10 : 0);
      const place = length > 0.25 * radius ? [middle + (dx / length) * out, middle + (dy / length) * out] : [x + 9, y - 9];
      this.labels.push(place);
      context.globalAlpha = z < -0.2 ? 0.6 : 1;
      context.lineWidth = 3;
      context.strokeStyle = halo;
      context.strokeText(name, ...place);
      context.strokeStyle = ink;
      context.fillText(name, ...place);
    }
    context.globalAlpha = 1;
  }

  /** A diamond on the chosen load, open where it lies behind the ball. */
  drawPicked(context, x, y, z) {
    const trace = (r) => {
      context.beginPath();
      [[0, -r], [r, 0], [0, r], [-r, 0]].forEach(([dx, dy], k) => context[k ? 'lineTo' : 'moveTo'](x + dx, y + dy));
      context.closePath();
    };
    trace(8);
    context.lineWidth = 4.5;
    context.strokeStyle = '#fff';
    context.stroke();
    context.lineWidth = 2;
    context.strokeStyle = '#111';
    context.stroke();
    if (z < 0) return;
    trace(3.5);
    context.fillStyle = '#111';
    context.fill();
  }

  /** A ring round the worst load; behind the ball, an arrow at the rim on its side. */
  drawWorst(context, x, y, z, middle, radius) {
    const trace = () => {
      context.beginPath();
      if (z >= 0) return context.arc(x, y, 7.5, 0, 2 * Math.PI);
      const length = Math.hypot(x - middle, y - middle) || 1;
      const [ux, uy] = [(x - middle) / length, (y - middle) / length];
      const [tx, ty] = [middle + ux * (radius - 3), middle + uy * (radius - 3)];
      context.moveTo(tx + 12 * ux + 6 * uy, ty + 12 * uy - 6 * ux);
      context.lineTo(tx, ty);
      context.lineTo(tx + 12 * ux - 6 * uy, ty + 12 * uy + 6 * ux);
    };
    for (const [colour, width] of [['#fff', 4.5], ['#111', 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      trace();
      context.stroke();
    }
  }
}
