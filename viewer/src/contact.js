// The two contact areas in the pad plane: pressure as a colour map, separation line, slip centre, friction directions.
// On plane faces the pressure is a plane, which an SVG gradient along its slope shows exactly; on others it is painted
// point by point on the face unrolled into the pad plane.

import { css, gradient, pressure as scale } from './colour.js';
import { inMm, niceStep, number, pressureUnit } from './format.js';
import { motionOf } from './motion.js';
import { inside } from './pads.js';

const SVG = 'http://www.w3.org/2000/svg';
const STOPS = 24;
/** Arrows across the larger side of the contact. */
const ARROWS = 9;
/** Points of a painted pressure along each side of a drawing. */
const POINTS = 320;
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
  // Square drawings, side by side, keep their place whatever the grip. Below, scale and axes have room.
  const side = 1.3 * Math.max(right - left, top - bottom);
  return { x: (left + right) / 2, y: (bottom + top) / 2 - 0.045 * side, side };
}

/** Fills the two figures in `root` for grip `i` of the report under load `load` (left out: the worst one). */
export function drawContact(root, report, i, prefix = '', load = report.column.load[i]) {
  const pad = report.header.gripper?.pad;
  const state = report.state(i, load) ?? report.state(i);
  const { slip } = state;
  const faces = [0, 1].map((face) => state.of(face).flatMap(({ rings }) => rings));
  const view = frame(pad, faces.flat(), slip);
  const tops = [0, 1].map((face) => (state.known ? state.largest(face) : 0));
  const largest = Math.max(...tops);
  const [unit, unitName] = pressureUnit(largest);
  root.querySelectorAll('figure').forEach((figure, face) => {
    const svg = figure.querySelector('svg');
    svg.replaceChildren();
    if (!view) return;
    drawFace({ svg, face, prefix, own: faces[face], pad, state, view, largest });
    const words = state.known ? `pressure up to ${number(tops[face] / unit)} ${unitName}` : 'no pressure known';
    svg.setAttribute('aria-label', `Contact on face ${report.column[face ? 'face_ii' : 'face_i'][i]}: ${words}`);
    const output = figure.querySelector('.probe');
    output.textContent = '';
    svg.onpointermove = (event) => {
      const spot = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      const [x, y] = [spot.x / 1e3, -spot.y / 1e3];
      const p = state.at(face, x, y);
      output.textContent = Number.isFinite(p) ? `${number(p / unit)} ${unitName} at (${number(x * 1e3)}, ${number(y * 1e3)}) mm` : '';
    };
    svg.onpointerleave = () => (output.textContent = '');
  });
  root.querySelectorAll('.pad-face').forEach((place, face) => (place.textContent = `on face ${report.column[face ? 'face_ii' : 'face_i'][i]}`));
  const legend = root.querySelector('.pressure-legend');
  legend.querySelector('.bar').style.background = gradient(scale);
  legend.querySelector('.max').textContent = state.known ? `${number(largest / unit)}\u00a0${unitName}` : 'unknown';
  root.querySelector('.slip').textContent = slipWords(report, i, slip);
}

/** A direction in the grip's frame: along an axis of the pads, or by its components. */
function axisWords(axis) {
  const along = axis.findIndex((v) => Math.abs(v) > 1 - 1e-6);
  if (along >= 0) return ['x\u2081', 'x\u2082', 'x\u2083'][along];
  const [a, b, c] = axis.map((v) => number(Math.abs(v) < 1e-6 ? 0 : v));
  return `(${a}, ${b}${Number(c) === 0 ? '' : `, ${c}`})`;
}

/** The incipient motion of grip `i` in words. */
function slipWords(report, i, slip) {
  const motion = motionOf(report, i, slip);
  const { type, on, pitch } = motion;
  const arrows = '; arrows: friction on the part.';
  if (type === 'turns') return `Would slip by turning about the centre (${inMm(motion.foot[0])}, ${inMm(motion.foot[1])})\u00a0mm${arrows}`;
  if (type === 'slides') return `Would slip straight, ${slip.type === 'translation' ? 'without turning' : 'all but without turning'}${arrows}`;
  if (type === 'rolls') return `Would roll about an axis along ${axisWords(motion.axis)}: it stays on pad ${on} and slips on the other${arrows}`;
  const along = pitch ? ` and slide ${number(Math.abs(pitch) * 2e3 * Math.PI)}\u00a0mm along it each turn` : '';
  if (type === 'spins') return `Would spin about an axis along ${axisWords(motion.axis)}${along}: it slips on both pads${arrows}`;
  if (type === 'none') return 'No load in the pad plane: nothing slips at any friction.';
  return 'No slip limit was found for this load.';
}

function drawFace({ svg, face, prefix, own, pad, state, view, largest }) {
  const side = view.side * 1e3;
  const [left, top] = [view.x * 1e3 - side / 2, -view.y * 1e3 - side / 2];
  svg.setAttribute('viewBox', `${left} ${top} ${side} ${side}`);
  const pixel = side / 170;
  const id = (name) => `${prefix}${name}-${face}`;
  const defs = element('defs');
  svg.append(defs);
  if (pad) svg.append(element('path', { d: path([{ points: pad }]), class: 'pad-outline' }));
  const area = element('path', { d: path(own), class: state.pieces ? 'contact-area reach' : 'contact-area', 'fill-rule': 'evenodd', fill: 'none' });
  const plane = state.plane(face);
  let pressed = null;
  if (plane) {
    svg.append(area);
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
  } else if (state.known && largest > 0) {
    pressed = painted(state, face, view, largest);
    svg.append(element('image', { href: pressed.image, x: left, y: top, width: side, height: side }), area);
  } else svg.append(area);
  arrows({ svg, own, state, face, pressed, view, largest, pixel });
  slipCentre({ svg, slip: state.slip, left, top, side, pixel });
  scaleBar({ svg, left, top, side, pixel });
}

/** The pressure on a face that is not plane as a picture of the window, and the box of what is pressed. */
function painted(state, face, view, largest) {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = POINTS;
  const context = canvas.getContext('2d');
  const image = context.createImageData(POINTS, POINTS);
  const step = view.side / POINTS;
  const [left, top] = [view.x - view.side / 2, view.y + view.side / 2];
  const box = [Infinity, -Infinity, Infinity, -Infinity];
  for (const piece of state.of(face)) {
    const corners = piece.rings[0].points;
    const range = (values, from, sign) => [Math.min(...values), Math.max(...values)].map((v) => (sign * (v - from)) / step).sort((a, b) => a - b);
    const [c0, c1] = range(corners.map((p) => p[0]), left, 1);
    const [r0, r1] = range(corners.map((p) => p[1]), top, -1);
    for (let row = Math.max(0, Math.floor(r0)); row < Math.min(POINTS, Math.ceil(r1)); row++) {
      for (let column = Math.max(0, Math.floor(c0)); column < Math.min(POINTS, Math.ceil(c1)); column++) {
        const [x, y] = [left + (column + 0.5) * step, top - (row + 0.5) * step];
        const p = state.on(piece, x, y);
        if (!(p > 0) || !inside(piece.rings, x, y)) continue;
        const paint = scale(p / largest);
        image.data.set([...paint, 255], 4 * (row * POINTS + column));
        [box[0], box[1], box[2], box[3]] = [Math.min(box[0], x), Math.max(box[1], x), Math.min(box[2], y), Math.max(box[3], y)];
      }
    }
  }
  context.putImageData(image, 0, 0);
  return { image: canvas.toDataURL(), box };
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

function arrows({ svg, own, state, face, pressed, view, largest, pixel }) {
  if (!state.known || !(largest > 0)) return;
  const points = own.flatMap((ring) => ring.points);
  if (points.length === 0) return;
  const xs = points.map((p) => p[0]);
  const ys = points.map((p) => p[1]);
  const [left, right, bottom, top] = pressed?.box ?? [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const step = Math.max((right - left) / ARROWS, (top - bottom) / ARROWS, view.side / 26);
  // The arrows stand about the middle, so that a strip narrower than a step has a row of them.
  const places = (from, to) => {
    const count = Math.max(1, Math.round((to - from) / step));
    return Array.from({ length: count }, (_, k) => (from + to) / 2 + (k - (count - 1) / 2) * step);
  };
  let d = '';
  for (const x of places(left, right)) {
    for (const y of places(bottom, top)) {
      const p = state.at(face, x, y) / largest;
      const direction = p > 0.02 ? state.friction(face, x, y) : null;
      if (!direction) continue;
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
