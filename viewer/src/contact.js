// The two contact areas in the pad plane: pressure as a colour map, separation line, slip centre, friction directions.
// The pressure is a plane, so an SVG gradient along its slope shows it exactly.

import { css, gradient, pressure as scale } from './colour.js';
import { inMm, niceStep, number, pressureUnit } from './format.js';

const SVG = 'http://www.w3.org/2000/svg';
const STOPS = 24;
/** Arrows across the larger side of the contact. */
const ARROWS = 9;
/** Share of the largest pressure below which a slope over the pad does not show. */
const FLAT = 1e-4;

function element(name, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

const path = (rings) => rings.map((ring) => `M${ring.points.map(([x, y]) => `${x * 1e3},${-y * 1e3}`).join('L')}Z`).join('');
const at = ([a0, a1, a2], x, y) => a0 + a1 * x + a2 * y;

function inside(rings, x, y) {
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

/** Unit friction direction on the body at a point, or null. */
function frictionAt(slip, x, y) {
  if (slip.type === 'translation') return slip.direction.map((v) => -v);
  if (slip.type !== 'rotation') return null;
  const [dx, dy] = [x - slip.c[0], y - slip.c[1]];
  const r = Math.hypot(dx, dy);
  return r > 0 ? [(slip.sense * dy) / r, (-slip.sense * dx) / r] : null;
}

/** The window [m] that both drawings share: pad, contacts, and the slip centre when it is near. */
function frame(pad, rings, slip) {
  const points = [...(pad ?? []), ...rings.flatMap((ring) => ring.points)];
  if (points.length === 0) return null;
  const xs = points.map((p) => p[0]);
  const ys = points.map((p) => p[1]);
  let [left, right, bottom, top] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const size = Math.max(right - left, top - bottom);
  if (slip.type === 'rotation') {
    const [x, y] = slip.c;
    const away = Math.max(left - x, x - right, bottom - y, y - top);
    if (away > -0.04 * size && away < 0.45 * size) {
      [left, right, bottom, top] = [Math.min(left, x - 0.06 * size), Math.max(right, x + 0.06 * size), Math.min(bottom, y - 0.06 * size), Math.max(top, y + 0.06 * size)];
    }
  }
  // Square drawings, side by side, keep their place whatever the grip.
  const side = 1.22 * Math.max(right - left, top - bottom);
  return { x: (left + right) / 2, y: (bottom + top) / 2, side };
}

/** Fills the two figures in `root` for grip `i` of the report. */
export function drawContact(root, report, i, prefix = '') {
  const pad = report.header.gripper?.pad;
  const rings = report.contact(i);
  const planes = report.pressure(i);
  const slip = report.slip(i);
  const view = frame(pad, rings, slip);
  const corners = (face) => rings.filter((ring) => ring.face === face).flatMap((ring) => ring.points);
  const largest = planes ? Math.max(0, ...[0, 1].flatMap((face) => corners(face).map(([x, y]) => at(planes[face], x, y)))) : 0;
  const [unit, unitName] = pressureUnit(largest);
  root.querySelectorAll('figure').forEach((figure, face) => {
    const svg = figure.querySelector('svg');
    svg.replaceChildren();
    if (!view) return;
    const own = rings.filter((ring) => ring.face === face);
    drawFace({ svg, face, prefix, own, pad, plane: planes?.[face], slip, view, largest });
    const words = planes ? `pressure up to ${number(Math.max(0, ...own.flatMap((r) => r.points.map(([x, y]) => at(planes[face], x, y)))) / unit)} ${unitName}` : 'no pressure known';
    svg.setAttribute('aria-label', `Contact on face ${report.column[face ? 'face_ii' : 'face_i'][i]}: ${words}`);
    const output = figure.querySelector('.probe');
    output.textContent = '';
    svg.onpointermove = (event) => {
      const spot = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const [x, y] = [spot.x / 1e3, -spot.y / 1e3];
      const p = planes && inside(own, x, y) ? Math.max(0, at(planes[face], x, y)) : NaN;
      output.textContent = Number.isFinite(p) ? `${number(p / unit)} ${unitName} at (${number(x * 1e3)}, ${number(y * 1e3)}) mm` : '';
    };
    svg.onpointerleave = () => (output.textContent = '');
  });
  root.querySelectorAll('.pad-face').forEach((place, face) => (place.textContent = `on face ${report.column[face ? 'face_ii' : 'face_i'][i]}`));
  const legend = root.querySelector('.pressure-legend');
  legend.querySelector('.bar').style.background = gradient(scale);
  legend.querySelector('.max').textContent = planes ? `${number(largest / unit)}\u00a0${unitName}` : 'unknown';
  root.querySelector('.slip').textContent = slipWords(slip);
}

function slipWords(slip) {
  if (slip.type === 'rotation') return `Would slip by turning about the centre (${inMm(slip.c[0])}, ${inMm(slip.c[1])})\u00a0mm; arrows: friction on the part.`;
  if (slip.type === 'translation') return 'Would slip straight, without turning; arrows: friction on the part.';
  if (slip.type === 'none') return 'No load in the pad plane: nothing slips at any friction.';
  return 'No slip limit was found for this load.';
}

function drawFace({ svg, face, prefix, own, pad, plane, slip, view, largest }) {
  const side = view.side * 1e3;
  const [left, top] = [view.x * 1e3 - side / 2, -view.y * 1e3 - side / 2];
  svg.setAttribute('viewBox', `${left} ${top} ${side} ${side}`);
  const pixel = side / 170;
  const id = (name) => `${prefix}${name}-${face}`;
  const defs = element('defs');
  svg.append(defs);
  if (pad) svg.append(element('path', { d: path([{ points: pad }]), class: 'pad-outline' }));
  const area = element('path', { d: path(own), class: 'contact-area', 'fill-rule': 'evenodd', fill: 'none' });
  svg.append(area);
  if (plane) {
    const [a0, a1, a2] = plane;
    const slope = Math.hypot(a1, a2);
    if (slope * view.side > FLAT * largest) {
      // Along the slope from the zero line to where the scale ends.
      const reach = (p) => [((p - a0) * a1) / slope ** 2, ((p - a0) * a2) / slope ** 2].map((v) => v * 1e3);
      const [[x1, y1], [x2, y2]] = [reach(0), reach(largest)];
      const stops = Array.from({ length: STOPS + 1 }, (_, k) => element('stop', { offset: k / STOPS, 'stop-color': css(scale(k / STOPS)) }));
      defs.append(element('linearGradient', { id: id('pressure'), gradientUnits: 'userSpaceOnUse', x1, y1: -y1, x2, y2: -y2 }, ...stops));
      area.setAttribute('fill', `url(#${id('pressure')})`);
      separation({ svg, defs, id, own, plane, slope, side, pixel });
    } else area.setAttribute('fill', css(scale(largest > 0 ? a0 / largest : 0)));
  }
  arrows({ svg, own, plane, slip, view, largest, pixel });
  slipCentre({ svg, slip, left, top, side, pixel });
  scaleBar({ svg, left, top, side, pixel });
}

/** The line of zero pressure and the part of the contact beyond it. */
function separation({ svg, defs, id, own, plane, slope, side, pixel }) {
  const values = own.flatMap((ring) => ring.points.map(([x, y]) => at(plane, x, y)));
  if (!(Math.min(...values) < 0)) return;
  const [a0, a1, a2] = plane;
  const foot = [(-a0 * a1) / slope ** 2, (-a0 * a2) / slope ** 2].map((v) => v * 1e3);
  const [nx, ny] = [a1 / slope, a2 / slope];
  const far = 4 * side;
  const point = (along, down) => `${foot[0] - ny * along - nx * down},${-(foot[1] + nx * along - ny * down)}`;
  const step = 5 * pixel;
  defs.append(
    element('pattern', { id: id('hatch'), width: step, height: step, patternUnits: 'userSpaceOnUse', patternTransform: 'rotate(45)' },
      element('rect', { width: step, height: step, class: 'separated' }), element('line', { x1: 0, y1: 0, x2: 0, y2: step, class: 'hatch', 'stroke-width': 1.6 * pixel })),
    element('clipPath', { id: id('beyond') }, element('path', { d: `M${point(-far, 0)}L${point(far, 0)}L${point(far, far)}L${point(-far, far)}Z` })),
  );
  svg.append(
    element('path', { d: path(own), 'fill-rule': 'evenodd', fill: `url(#${id('hatch')})`, 'clip-path': `url(#${id('beyond')})` }),
    element('path', { d: `M${point(-far, 0)}L${point(far, 0)}`, class: 'separation-line' }),
  );
}

function arrows({ svg, own, plane, slip, view, largest, pixel }) {
  if (!plane || !(largest > 0)) return;
  const points = own.flatMap((ring) => ring.points);
  if (points.length === 0) return;
  const xs = points.map((p) => p[0]);
  const ys = points.map((p) => p[1]);
  const [left, right, bottom, top] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const step = Math.max((right - left) / ARROWS, (top - bottom) / ARROWS, view.side / 26);
  let d = '';
  for (let x = left + step / 2; x < right; x += step) {
    for (let y = bottom + step / 2; y < top; y += step) {
      const direction = inside(own, x, y) && frictionAt(slip, x, y);
      const p = at(plane, x, y) / largest;
      if (!direction || p <= 0.02) continue;
      // Length shows the size of the friction; short ones keep a visible head.
      const length = step * (0.3 + 0.55 * Math.min(p, 1)) * 1e3;
      const [ux, uy] = [direction[0], -direction[1]];
      const [bx, by] = [x * 1e3 - (ux * length) / 2, -y * 1e3 - (uy * length) / 2];
      const [ex, ey] = [bx + ux * length, by + uy * length];
      const head = Math.min(0.4 * length, 4 * pixel);
      const wing = (turn) => `${ex - head * (ux * 0.87 - turn * uy * 0.5)},${ey - head * (uy * 0.87 + turn * ux * 0.5)}`;
      d += `M${bx},${by}L${ex},${ey}M${wing(1)}L${ex},${ey}L${wing(-1)}`;
    }
  }
  // A pale halo keeps the arrows readable on either end of the colour map.
  svg.append(element('path', { d, class: 'arrow-halo' }), element('path', { d, class: 'arrow' }));
}

function slipCentre({ svg, slip, left, top, side, pixel }) {
  if (slip.type !== 'rotation') return;
  const [x, y] = [slip.c[0] * 1e3, -slip.c[1] * 1e3];
  const margin = 7 * pixel;
  const near = x > left + margin && x < left + side - margin && y > top + margin && y < top + side - margin;
  if (near) {
    const r = 4.5 * pixel;
    const cross = `M${x - 2 * r},${y}H${x + 2 * r}M${x},${y - 2 * r}V${y + 2 * r}`;
    svg.append(element('path', { d: cross, class: 'slip-halo' }), element('circle', { cx: x, cy: y, r, class: 'slip-centre' }), element('path', { d: cross, class: 'slip-cross' }));
    return;
  }
  // Far away: an arrow at the rim points there.
  const [mx, my] = [left + side / 2, top + side / 2];
  const [ux, uy] = [x - mx, y - my].map((v) => v / Math.hypot(x - mx, y - my));
  // Below lie the scale and the axes.
  const free = side / 2 - 4 * pixel;
  const reach = Math.min(free / Math.abs(ux), (uy > 0 ? free - 18 * pixel : free) / Math.abs(uy));
  const [ex, ey] = [mx + ux * reach, my + uy * reach];
  const wing = (turn) => `${ex - 9 * pixel * ux + turn * 4.5 * pixel * uy},${ey - 9 * pixel * uy - turn * 4.5 * pixel * ux}`;
  svg.append(element('path', { d: `M${wing(1)}L${ex},${ey}L${wing(-1)}Z`, class: 'slip-far' }));
}

function scaleBar({ svg, left, top, side, pixel }) {
  const length = niceStep(side / 3.2);
  const [x, y] = [left + 6 * pixel, top + side - 6 * pixel];
  svg.append(
    element('path', { d: `M${x},${y - 2.5 * pixel}v${2.5 * pixel}h${length}v${-2.5 * pixel}`, class: 'scale-bar' }),
    element('text', { x: x + length + 3 * pixel, y, class: 'scale-text', 'font-size': 9.5 * pixel }, `${number(length, 2).replace(/\.0$/, '')} mm`),
  );
  const axis = 13 * pixel;
  const [ox, oy] = [left + side - 30 * pixel, top + side - 8 * pixel];
  svg.append(
    element('path', { d: `M${ox},${oy - axis}V${oy}H${ox + axis}`, class: 'scale-bar' }),
    element('text', { x: ox + axis + 2 * pixel, y: oy + 2 * pixel, class: 'scale-text', 'font-size': 9 * pixel }, 'x\u2081'),
    element('text', { x: ox - 3 * pixel, y: oy - axis - 3 * pixel, class: 'scale-text', 'font-size': 9 * pixel }, 'x\u2082'),
  );
}
