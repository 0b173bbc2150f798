// What is taken along from the page: a pose, a picture, files for other programs, a print.

import { drawContact } from './contact.js';
import { quaternion, verdict } from './detail.js';
import { count, degrees, mm, newtons, number, percent } from './format.js';
import { facts, node } from './run.js';

/** Puts `text` on the clipboard, and says on `button` whether that worked. */
export async function copy(text, button) {
  const name = (button.dataset.name ??= button.textContent);
  let done = true;
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    // Refused to some local files: the older way asks nobody.
    const area = document.body.appendChild(document.createElement('textarea'));
    area.value = text;
    area.select();
    done = document.execCommand('copy');
    area.remove();
    button.focus();
  }
  button.textContent = done ? 'Copied' : 'Copying was refused';
  clearTimeout(button.clock);
  button.clock = setTimeout(() => (button.textContent = name), 1500);
}

/** Tool frames by name: axes in words, and the axes as multiples of (x1, x2, x3), column by column. */
const FRAMES = {
  standard: ['z approach, y closing', [[0, 1, 0], [0, 0, 1], [1, 0, 0]]],
  graspgen: ['z approach, x closing', [[0, 0, 1], [0, -1, 0], [1, 0, 0]]],
  graspnet: ['x approach, y closing', [[1, 0, 0], [0, 0, 1], [0, -1, 0]]],
  grip: ['x approach, z closing', [[1, 0, 0], [0, 1, 0], [0, 0, 1]]],
};
const ORIGINS = { pads: 'midway between the pads', flange: 'at the flange', tool: "at the gripper's tool frame" };
/** Digits that the page's numbers carry. */
const DIGITS = 7;
/** Grips that are printed at once. */
const PRINTED = 20;

const add = (a, b, factor = 1) => a.map((v, k) => v + factor * b[k]);

/** The tool frame of grip `i` in the part frame: `{ x, y, z, origin }`, metres. */
export function toolPose(report, i, frame, origin) {
  const { x: along, z: aside } = palmPlace(report, i);
  const { x1, x2, x3, origin: middle } = report.pose(i);
  const turn = (v) => [0, 1, 2].map((k) => v[0] * x1[k] + v[1] * x2[k] + v[2] * x3[k]);
  const { gripper } = report.header;
  const stated = (name) => [0, 1, 2, 3].map((k) => gripper[name].slice(4 * k, 4 * k + 3));
  const axes = FRAMES[frame]?.[1] ?? stated(frame).slice(0, 3);
  const [x, y, z] = axes.map(turn);
  return { x, y, z, origin: origin === 'pads' ? middle : add(middle, turn(add(stated(origin)[3], [along, 0, aside]))) };
}

/** The quaternion (x, y, z, w) of a pose with w >= 0; of half a turn the one whose first other part is positive. */
function turned({ x, y, z }) {
  const q = quaternion({ x1: x, x2: y, x3: z });
  const first = [q[3], q[0], q[1], q[2]].find((v) => Math.abs(v) > 1e-6);
  return first < 0 ? q.map((v) => -v) : q;
}

/** `value` with `digits` significant digits, in plain ASCII; rounding beside one is zero. */
const plain = (value, digits) => (Math.abs(value) < 1e-9 ? '0' : String(Number(value.toPrecision(digits))));

function poseText(report, i, { frame, origin, form, unit, digits }) {
  const pose = toolPose(report, i, frame, origin);
  const factor = unit === 'mm' ? 1e3 : 1;
  const say = (value) => plain(value, digits);
  const place = pose.origin.map((v) => say(v * factor));
  const q = turned(pose).map(say);
  if (form === 'quaternion') return `x y z (${unit}): ${place.join(' ')}\nqx qy qz qw: ${q.join(' ')}`;
  const rows = [0, 1, 2].map((k) => [say(pose.x[k]), say(pose.y[k]), say(pose.z[k]), place[k]]);
  if (form === 'matrix') return [...rows, ['0', '0', '0', '1']].map((row) => row.join(' ')).join('\n');
  return `{"id": ${report.column.id[i]}, "position_${unit}": [${place.join(', ')}], "quaternion_xyzw": [${q.join(', ')}], "frame": ${JSON.stringify(frameWords(report, frame, origin))}}`;
}

const frameWords = (report, frame, origin) => `${FRAMES[frame]?.[0] ?? `axes of the gripper's ${frame === 'tool' ? 'tool frame' : frame}`}, origin ${ORIGINS[origin]}`;

/** The shortest text that reads back as the same single-precision number. */
function short(value) {
  if (!Number.isFinite(value)) return '';
  for (let digits = 6; digits < 9; digits++) if (Math.fround(Number(value.toPrecision(digits))) === Math.fround(value)) return String(Number(value.toPrecision(digits)));
  return String(Number(value.toPrecision(9)));
}

/** Distance of the pads in grip `i`, and before closing [m]. */
export function gaps(report, i) {
  return gapsOf(report, report.column.width[i], report.column.inside[i] === 1);
}

/** The same of a grip of faces `width` apart [m]. */
export function gapsOf(report, width, inside) {
  const { gripper, asked } = report.header;
  const gap = width - (inside ? 2 * (gripper?.outer_pad ?? 0) : 0);
  if (!gripper) return [gap, gap];
  const [least, most] = gripper.stroke;
  const way = 2 * (asked.opening ?? Infinity);
  return [gap, inside ? Math.min(Math.max(gap - way, least), gap) : Math.max(Math.min(gap + way, most), gap)];
}

/** Where the palm stands in grip `i` along x1 and x3, seen from where the gripper file places it, and the pads' distance [m]. */
export function palmPlace(report, i) {
  const { palm } = report.column;
  return { x: palm[2 * i], z: palm[2 * i + 1], gap: gaps(report, i)[0] };
}

/** Where the palm stands along x1 with the pads `gap` apart, seen from the pads [m]. */
export function palmAlong(report, gap) {
  const travel = report.header.gripper?.travel ?? [];
  const k = Math.max(1, travel.findIndex(([at]) => at >= gap));
  if (travel.length < 2 || !travel[k]) return travel.at(-1)?.[1] ?? 0;
  const [[from, start], [to, end]] = [travel[k - 1], travel[k]];
  return start + ((end - start) * (gap - from)) / (to - from || 1);
}

/** One row per grip: the columns of the program's CSV, as text. */
export function table(report, indices, frame, origin) {
  const c = report.column;
  const words = frameWords(report, frame, origin);
  const { part, gripper, asked } = report.header;
  const forceRange = (i) => {
    const [least, most] = gripper?.force ?? [];
    const needed = c.force_needed[i];
    if (!Number.isFinite(needed) || most === undefined) return '';
    return needed > most * (1 + 1e-6) ? 'above' : needed < least * (1 - 1e-6) ? 'below' : 'within';
  };
  const slips = { rotation: 'rotation', translation: 'translation', spin: 'spin', none: 'none', unknown: '' };
  const say = (value) => plain(value, DIGITS);
  const ring = (points) => Math.abs(points.reduce((sum, [x, y], k) => sum + (x * points[(k + 1) % points.length][1] - y * points[(k + 1) % points.length][0]) / 2, 0));
  return indices.map((i) => {
    const pose = toolPose(report, i, frame, origin);
    const grip = report.pose(i);
    const q = turned(pose);
    const [gap, opened] = gaps(report, i);
    const area = [0, 0];
    for (const { face, hole, points } of report.contact(i)) area[face] += (hole ? -1 : 1) * ring(points);
    const slip = report.slip(i);
    const of = (name) => short(c[name][i]);
    const vector = (names, values) => Object.fromEntries(names.map((name, k) => [name, say(values[k])]));
    return {
      rank: String(c.rank[i]), id: String(c.id[i]), score: of('score'), mu_s: of('mu'), status: report.status(i), verdict: ['unknown', 'holds', 'slips'][c.verdict[i]], load: String(c.load[i]), load_name: report.load(i).name,
      width_m: of('width'), side: c.inside[i] ? 'inside' : 'outside', jaw_gap_m: say(gap), opened_gap_m: say(opened),
      ...vector(['x_m', 'y_m', 'z_m'], pose.origin), ...vector(['qx', 'qy', 'qz', 'qw'], q),
      ...vector(['approach_x', 'approach_y', 'approach_z'], grip.x1), ...vector(['closing_x', 'closing_y', 'closing_z'], grip.x3),
      tool_frame: words, face_i: String(c.face_i[i]), face_ii: String(c.face_ii[i]), angle_rad: of('angle'), area_i_m2: short(area[0]), area_ii_m2: short(area[1]),
      pad_share: short(report.cover(i)), contact_share: of('contact_share'), twist_margin: of('twist_margin'), alpha_rad: of('alpha'), delta_d_m: of('delta_d'), safety: of('safety'), force_needed_n: of('force_needed'), force_range: forceRange(i), load_multiple: of('load_multiple'),
      slip: slips[slip.type], slip_c1_m: slip.c ? short(slip.c[0]) : '', slip_c2_m: slip.c ? short(slip.c[1]) : '',
      ...Object.fromEntries(['force_1_n', 'force_2_n', 'force_3_n', 'moment_1_nm', 'moment_2_nm', 'moment_3_nm'].map((name, k) => [name, short(c.wrench[6 * i + k])])),
      mu_lower: short(c.bounds[2 * i]), mu_upper: short(c.bounds[2 * i + 1]), residual: of('residual'),
      part: part.file, gripper: gripper?.name ?? '', mass_kg: say(part.mass.mass), force_n: say(asked.force), pad_friction: asked.pad_friction === null ? '' : say(asked.pad_friction), safety_asked: say(asked.safety),
    };
  });
}

function csv(rows) {
  const quote = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  return [Object.keys(rows[0] ?? {}), ...rows.map(Object.values)].map((row) => `${row.map(quote).join(',')}\n`).join('');
}

const TEXTS = new Set(['status', 'verdict', 'load_name', 'side', 'tool_frame', 'slip', 'force_range', 'part', 'gripper']);

function json(report, rows) {
  const value = ([name, text]) => [name, TEXTS.has(name) ? text : text === '' ? null : Number(text)];
  const { part, gripper, provenance } = report.header;
  return `${JSON.stringify({ format: 'gripfast-page', version: 1, part: part.file, gripper: gripper?.name ?? null, gripfast: provenance.gripfast, note: `numbers have ${DIGITS} digits; SI units`, grips: rows.map((row) => Object.fromEntries(Object.entries(row).map(value))) }, null, 1)}\n`;
}

function isaac(report, rows) {
  const quote = (text) => JSON.stringify(text);
  const lines = ['format: isaac_grasp', 'format_version: 1.0', '', '# position: metres; orientation: unit quaternion; both of the gripper frame in the part frame.',
    `# gripper frame: ${rows[0]?.tool_frame ?? ''}`, 'object_frame: "part"', `gripper_frame: ${quote(report.header.gripper?.name ?? 'gripper')}`, '', `grasps:${rows.length ? '' : ' {}'}`];
  for (const row of rows) {
    lines.push(`  "grasp_${row.id}":`, `    confidence: ${plain(report.quality(report.indexOfId.get(Number(row.id))), DIGITS)}`, `    position: [${row.x_m}, ${row.y_m}, ${row.z_m}]`, `    orientation: {w: ${row.qw}, xyz: [${row.qx}, ${row.qy}, ${row.qz}]}`,
      '    cspace_position:', `      "width": ${row.jaw_gap_m}`, '    pregrasp_cspace_position:', `      "width": ${row.opened_gap_m}`);
  }
  return `${lines.join('\n')}\n`;
}

function save(name, content, type) {
  const link = document.createElement('a');
  link.download = name;
  link.href = URL.createObjectURL(content instanceof Blob ? content : new Blob([content], { type }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

const DRAWN = ['fill', 'stroke', 'stroke-width', 'stroke-dasharray', 'stroke-linecap', 'stroke-linejoin', 'opacity', 'fill-rule', 'font-family', 'paint-order', 'vector-effect'];

/** Both pads as one drawing that needs no style sheet. */
function padsSvg(root, title) {
  const drawings = [...root.querySelectorAll('.contact figure')].map((figure) => {
    const svg = figure.querySelector('svg');
    const held = svg.cloneNode(true);
    const [from, to] = [svg, held].map((tree) => [...tree.querySelectorAll('path, circle, text, rect, line')]);
    from.forEach((element, k) => {
      const style = getComputedStyle(element);
      to[k].setAttribute('style', DRAWN.map((name) => `${name}:${style.getPropertyValue(name)}`).join(';'));
    });
    return { view: svg.getAttribute('viewBox'), inner: held.innerHTML, name: figure.querySelector('figcaption span').textContent };
  });
  const escape = (text) => text.replaceAll('&', '&amp;').replaceAll('<', '&lt;');
  const style = getComputedStyle(document.documentElement);
  const [ground, ink] = ['--panel', '--ink'].map((name) => style.getPropertyValue(name).trim());
  const pads = drawings.map(({ view, inner, name }, k) => `<svg x="${20 + 420 * k}" y="50" width="400" height="400" viewBox="${view}">${inner}</svg><text x="${20 + 420 * k}" y="476" font-size="16" fill="${ink}">${escape(name)}</text>`);
  return `<svg xmlns="http://www.w3.org/2000/svg" width="860" height="500" viewBox="0 0 860 500" font-family="system-ui, sans-serif"><rect width="860" height="500" fill="${ground}"/><text x="20" y="32" font-size="20" font-weight="600" fill="${ink}">${escape(title)}</text>${pads.join('')}</svg>\n`;
}

const caption = (report, i) => `Grip ${count(report.column.rank[i])}: ${verdict(report, i)[0].toLowerCase()}, friction needed ${number(report.mu(i))}${Number.isFinite(report.safety(i)) ? `, safety ${number(report.safety(i))}` : ''}`;

/** The view as a picture for a slide, with a line of words below. */
function picture(report, view, i, width = 1920, height = 1080) {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [width, height];
  const context = canvas.getContext('2d');
  const style = getComputedStyle(document.documentElement);
  context.fillStyle = style.getPropertyValue('--panel');
  context.fillRect(0, 0, width, height);
  const strip = Math.round(height / 13);
  view.paint(width, height - strip, (drawn) => context.drawImage(drawn, 0, 0));
  context.fillStyle = style.getPropertyValue('--ink');
  context.font = `600 ${Math.round(strip * 0.36)}px system-ui, sans-serif`;
  context.textBaseline = 'middle';
  const file = report.header.part.file.split(/[\\/]/).pop();
  context.fillText(`${file}, ${report.header.gripper?.name ?? ''}. ${caption(report, i)}`, strip * 0.5, height - strip / 2, width - strip);
  return canvas;
}

/** Connects the panel "Take it along". `marks`: set of marked grips; `state`: chosen and listed ones. */
export class Take {
  constructor(root, report, view, state) {
    Object.assign(this, { root, report, view, state });
    const { gripper } = report.header;
    const find = (name) => root.querySelector(`[data-take="${name}"]`);
    const frames = [...Object.entries(FRAMES).map(([name, [axes]]) => [name, `${name} (${axes})`]), ...['flange', 'tool'].filter((name) => gripper?.[name]).map((name) => [name, `the gripper's ${name}`])];
    find('frame').append(...frames.map(([value, name]) => new Option(name, value)));
    find('origin').append(...Object.entries(ORIGINS).filter(([name]) => name === 'pads' || gripper?.[name]).map(([value, name]) => new Option(name, value)));
    this.find = find;
    root.addEventListener('input', () => this.show());
    find('copy').addEventListener('click', () => copy(find('text').textContent, find('copy')));
    root.addEventListener('click', (event) => {
      const { file } = event.target.closest('button')?.dataset ?? {};
      if (file) this.file(file);
    });
    root.querySelector('[data-file="png"]').disabled = !view;
    window.addEventListener('beforeprint', () => this.print());
  }

  /** What is chosen: frame, origin, form, unit, digits. */
  choice() {
    const value = (name) => this.find(name).value;
    const digits = Math.min(Math.max(Math.round(Number(value('digits'))) || 6, 2), DIGITS);
    return { frame: value('frame'), origin: value('origin'), form: value('form'), unit: value('unit'), digits };
  }

  show() {
    const i = this.state.chosen;
    if (i < 0) return;
    this.find('text').textContent = poseText(this.report, i, this.choice());
    const which = this.find('which');
    which.options[1].text = `${count(this.state.marked.size)} marked`;
    which.options[1].disabled = this.state.marked.size === 0;
    which.options[2].text = `${count(this.state.order.length)} listed`;
    if (which.selectedOptions[0].disabled) which.selectedIndex = 0;
  }

  /** The grips that a file is written of. */
  indices() {
    const which = this.find('which').value;
    return which === 'listed' ? this.state.order : which === 'marked' ? this.marked() : [this.state.chosen];
  }

  marked() {
    return [...this.state.marked].sort((a, b) => a - b);
  }

  /** A file's text by its kind. */
  text(kind) {
    const { frame, origin } = this.choice();
    const rows = table(this.report, this.indices(), frame, origin);
    return kind === 'csv' ? csv(rows) : kind === 'json' ? json(this.report, rows) : isaac(this.report, rows);
  }

  file(kind) {
    const i = this.state.chosen;
    const part = this.report.header.part.file.split(/[\\/]/).pop().replace(/\.[^.]*$/, '').replace(/[^\w-]+/g, '_') || 'part';
    const one = `${part}-grip-${this.report.column.id[i]}`;
    if (kind === 'print') window.print();
    else if (kind === 'png') picture(this.report, this.view, i).toBlob((blob) => save(`${one}.png`, blob));
    else if (kind === 'svg') save(`${one}-pads.svg`, padsSvg(document, caption(this.report, i)), 'image/svg+xml');
    else if (kind === 'csv') save(`${part}.csv`, this.text(kind), 'text/csv');
    else if (kind === 'json') save(`${part}.json`, this.text(kind), 'application/json');
    else save(`${part}.isaac_grasp.yaml`, this.text(kind), 'application/yaml');
  }

  /** Fills the pages for the printer: one for each marked grip, or the chosen one. */
  print() {
    const { report, view, state } = this;
    const place = document.querySelector('#print');
    place.replaceChildren();
    if (state.chosen < 0) return;
    const pair = document.querySelector('.contact .pair');
    const camera = view?.camera.position.clone();
    const target = view?.controls.target.clone();
    const grips = (state.marked.size ? this.marked() : [state.chosen]).slice(0, PRINTED);
    for (const i of grips) {
      const page = node('article');
      const file = report.header.part.file.split(/[\\/]/).pop();
      page.append(node('h2', caption(report, i)), node('p', `${file}, ${report.header.gripper?.name ?? ''}, id ${report.column.id[i]}, worst load ${report.load(i).name}`));
      if (view) {
        view.setGrip(i, false);
        view.setLoad(report.column.load[i], report.state(i));
        view.fit(i, true);
        const image = node('img', undefined, { alt: 'Part and gripper' });
        image.src = picture(report, view, i, 1200, 640).toDataURL();
        page.append(image);
      }
      const c = report.column;
      page.append(facts([['Friction needed', number(report.mu(i))], ['Safety', number(report.safety(i))], ['Squeeze needed', newtons(report.squeeze(i))], ['Width', mm(c.width[i])],
        ['Pad covered', percent(report.cover(i))], ['Contact left', percent(c.contact_share[i])], ['Twist-out margin', percent(c.twist_margin[i])], ['Self-aligning tilt', degrees(c.alpha[i])]]));
      const pads = node('div');
      pads.append(pair.cloneNode(true), node('p', undefined, { class: 'slip' }), document.querySelector('.contact .pressure-legend').cloneNode(true));
      drawContact(pads, report, i, `print-${i}-`);
      page.append(pads, node('pre', `${frameWords(report, this.choice().frame, this.choice().origin)}\n${poseText(report, i, { ...this.choice(), form: 'quaternion' })}`));
      place.append(page);
    }
    if (!view) return;
    // As it was: grip, load, and the side that is looked from.
    view.setGrip(state.chosen, false);
    this.onPrinted?.();
    view.camera.position.copy(camera);
    view.controls.target.copy(target);
    view.controls.update();
    view.render();
  }
}
