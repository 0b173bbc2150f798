// The chosen grip in numbers, its contact areas and its loads.

import { css, gradient, friction, NO_LIMIT } from './colour.js';
import { drawContact } from './contact.js';
import { chosen, count, degrees, mm, newtons, NONE, number, percent, words } from './format.js';
import { facts, node } from './run.js';

export const STATUS = {
  ok: ['Slip limit found', 'good', 'A slip limit exists; no other was found.'],
  separating: ['Separating', 'fair', 'Part of the pads lifts off; such grips were to be discarded.'],
  ambiguous: ['Ambiguous', 'fair', 'A slip limit was found, but another one exists or could not be excluded.'],
  twisted_out: ['Twists out', 'bad', 'No slip limit exists for this load: the contact twists out.'],
  no_normal_force: ['No normal force', 'bad', 'The load along the closing axis takes the force off one pad.'],
  no_contact: ['No contact', 'bad', 'A contact area is empty.'],
  not_converged: ['Not converged', 'fair', 'The numbers are the best found; the residual is above its target.'],
};

export const statusOf = (name) => STATUS[name] ?? [words(name), 'fair', ''];

/** What the status means with the pads' friction, where that is known: name, kind, explanation. */
export function verdict(report, i) {
  const known = statusOf(report.status(i));
  if (!['ok', 'ambiguous'].includes(report.status(i)) || report.holds(i) === null) return known;
  const about = report.estimate ? '\u2248 ' : '';
  if (report.holds(i)) return report.status(i) === 'ok' ? [`${about}Holds`, 'good', ''] : known;
  return [`${about}Slips`, 'bad', report.now.safety > 1 && report.safety(i) >= 1 ? 'It holds, but with less safety than is asked for.' : 'The worst load needs more friction than the pads have at this gripping force.'];
}

const LOADS_SHOWN = 6;

/** Components that are nothing but rounding beside the largest one are zeros. */
function vectorText(values, factor, unit) {
  const least = 1e-9 * Math.max(...values.map(Math.abs));
  return `(${values.map((v) => number(Math.abs(v) < least ? 0 : v * factor)).join(', ')})\u00a0${unit}`;
}

/** Quaternion (x, y, z, w) of orthonormal columns. */
export function quaternion({ x1, x2, x3 }) {
  const m = [[x1[0], x2[0], x3[0]], [x1[1], x2[1], x3[1]], [x1[2], x2[2], x3[2]]];
  const trace = m[0][0] + m[1][1] + m[2][2];
  if (trace > 0) {
    const s = 2 * Math.sqrt(trace + 1);
    return [(m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s, s / 4];
  }
  const i = [0, 1, 2].reduce((best, k) => (m[k][k] > m[best][best] ? k : best), 0);
  const [j, k] = [(i + 1) % 3, (i + 2) % 3];
  const s = 2 * Math.sqrt(1 + m[i][i] - m[j][j] - m[k][k]);
  const q = [0, 0, 0, (m[k][j] - m[j][k]) / s];
  q[i] = s / 4;
  q[j] = (m[j][i] + m[i][j]) / s;
  q[k] = (m[k][i] + m[i][k]) / s;
  return q;
}

export class Detail {
  constructor(root, report, ball) {
    this.root = root;
    this.report = report;
    this.ball = ball;
    this.find = (selector) => root.querySelector(selector);
    this.find('.ball-legend .bar').style.background = gradient(friction);
    this.find('.swatch.none').style.background = css(NO_LIMIT);
    if (ball) {
      ball.hover = (hit) => {
        this.find('.ball-probe').textContent = hit ? `${this.report.header.loads[hit.load].name}: ${Number.isFinite(hit.mu) ? number(this.report.scaled(hit.mu)) : 'no slip limit'}` : '';
      };
      ball.onPick = (load) => this.pick(load);
    }
  }

  show(i) {
    const { report } = this;
    const c = report.column;
    this.grip = i;
    const [name, kind, meaning] = verdict(report, i);
    this.find('.grip-title').textContent = `Grip ${count(c.rank[i])}`;
    const pill = this.find('.pill');
    pill.className = `pill ${kind}`;
    pill.textContent = name;
    this.find('.grip-sub').textContent = `${c.inside[i] ? 'From inside, faces' : 'Faces'} ${c.face_i[i]} and ${c.face_ii[i]}, id ${c.id[i]}${Number.isFinite(c.flip_of[i]) ? `, jaws exchanged of ${c.flip_of[i]}` : ''}${this.turns(i)}`;
    this.find('.meaning').textContent = kind === 'good' ? '' : meaning;
    this.numbers(i);
    this.loads(i);
    this.full(i);
  }

  /** That grip `i` is one of several that a turn of the part, about its axis or middle, maps to each other. */
  turns(i) {
    const first = this.report.column.turn_of?.[i];
    const turns = this.report.turns.get(first) ?? 1;
    return turns < 2 ? '' : `, one of ${count(turns)} that a turn of the part maps to each other${first === this.report.column.id[i] ? '' : `, the first of them id ${first}`}`;
  }

  numbers(i) {
    const { column: c, friction: padFriction } = this.report;
    const tile = (id, value, note) => {
      const place = this.find(`[data-value="${id}"]`);
      place.querySelector('.value').textContent = value;
      place.querySelector('.note').textContent = note;
    };
    const about = this.report.estimate ? '\u2248\u2009' : '';
    const asked = this.report.now.safety;
    tile('mu', `${about}${number(this.report.mu(i))}`, this.report.estimate ? `estimate at ${newtons(this.report.now.force)}` : 'at the worst load');
    const safety = this.report.safety(i);
    tile('safety', Number.isFinite(safety) ? `${about}${number(safety)}\u00d7` : c.mu[i] === 0 ? '\u221e' : NONE, padFriction ? `pad friction ${chosen(padFriction)}${asked === 1 ? '' : `, ${chosen(asked)}\u00d7 asked`}` : 'pad friction not stated');
    const range = { above: ' \u2013 more than the gripper has', below: ' \u2013 below the gripper\u2019s least' }[this.report.forceRange(i)] ?? '';
    tile('squeeze', `${this.report.squeezeEstimate && Number.isFinite(c.force_needed[i]) ? '\u2248\u2009' : ''}${newtons(this.report.squeeze(i))}`, padFriction ? `per jaw${range}` : 'pad friction not stated');
    tile('width', mm(c.width[i]), c.inside[i] ? 'from face to face, held from inside' : 'from face to face');
    this.find('.more').replaceChildren(
      facts([
        ['Contact left', percent(c.contact_share[i])],
        ['Pad covered', percent(this.report.cover(i))],
        ['Twist-out margin', percent(c.twist_margin[i])],
        ['Self-aligning tilt \u03b1', degrees(c.alpha[i])],
        ['Spread to twist out \u0394d', mm(c.delta_d[i])],
        ['Score', number(c.score[i], 4)],
        ['Approach angle', degrees(c.angle[i])],
        ...['I', 'II'].map((name, face) => [`Pressed on pad ${name}`, this.report.pressedArea(i, face)]),
      ]),
      ...this.report.notes(i).map((text) => node('p', `Note: ${text}`, { class: 'quiet' })),
    );
  }

  loads(i) {
    const { header } = this.report;
    const range = this.ball?.setGrip(i);
    const values = this.report.byLoad(i)?.map((mu) => this.report.scaled(mu));
    const legend = this.find('.ball-legend');
    legend.style.visibility = range ? 'visible' : 'hidden';
    if (range) {
      legend.querySelector('.min').textContent = number(this.report.scaled(range.low));
      legend.querySelector('.max').textContent = number(this.report.scaled(range.high));
      this.find('.missing').textContent = range.missing ? `no slip limit: ${count(range.missing)}` : '';
      this.find('.swatch.none').hidden = !range.missing;
    } else {
      this.find('.missing').textContent = '';
      this.find('.swatch.none').hidden = true;
    }
    const worst = this.report.column.load[i];
    this.find('.worst-load').textContent = header.loads[worst].name;
    const sorted = values ? [...values].map((mu) => (Number.isFinite(mu) ? mu : Infinity)).sort((a, b) => a - b) : [];
    const part = (share) => (sorted.length ? number(sorted[Math.round((sorted.length - 1) * share)]) : NONE);
    const hardest = ['Hardest load', values ? part(1) : number(this.report.mu(i))];
    this.find('.spread').replaceChildren(facts(values ? [['Easiest load', part(0)], ['Median', part(0.5)], hardest] : [hardest]));
    const canvas = this.find('.ball');
    canvas.setAttribute('aria-label', range
      ? `Friction needed over ${count(header.loads.length)} loads: ${number(this.report.scaled(range.low))} to ${number(this.report.scaled(range.high))}, worst under ${header.loads[worst].name}`
      : `Worst load ${header.loads[worst].name}; the table of all loads was not stored`);
    const sizes = header.loads.map((load) => Math.hypot(...load.wrench.force)).filter((size) => size > 0);
    const [least, most] = [Math.min(...sizes), Math.max(...sizes)];
    const strength = most > 1.02 * least ? ` The loads differ in size: ${number(least)} to ${newtons(most)}.` : '';
    this.find('.ball-note').textContent = values ? `A point of the ball is the direction in which a load pushes the part; it turns with the view.${strength}` : 'Only the worst load of this grip was stored: a page has every load of the best 20 grips, with gripfast plan --polish all of every grip.';
    const body = this.find('.loads tbody');
    body.replaceChildren();
    const order = this.report.hardestFirst(i);
    for (const load of order.slice(0, LOADS_SHOWN)) {
      const row = body.insertRow();
      if (load === worst) row.className = 'worst';
      row.dataset.load = load;
      const name = document.createElement('button');
      name.type = 'button';
      name.className = 'link';
      name.textContent = this.shortName(load);
      name.title = header.loads[load].name;
      name.addEventListener('click', () => this.pick(load));
      row.insertCell().append(name);
      row.insertCell().textContent = number(values ? values[load] : this.report.mu(i));
    }
    this.pick(-1);
    this.find('.loads caption').textContent = order.length > LOADS_SHOWN ? `The ${LOADS_SHOWN} hardest of ${count(order.length)} loads` : 'Loads, hardest first';
  }

  /** Chooses a load of the grip shown (-1: the worst one): on the ball, in the table, in words, and in the view. */
  pick(load) {
    const { report } = this;
    const worst = report.column.load[this.grip];
    this.load = load >= 0 && load !== worst ? load : -1;
    this.ball?.pick(this.load);
    this.root.querySelectorAll('.loads tr').forEach((row) => row.toggleAttribute('data-picked', Number(row.dataset.load) === this.load));
    this.find('.picked').hidden = this.find('#unpick').hidden = this.load < 0;
    if (this.load >= 0) {
      const mu = report.byLoad(this.grip)?.[this.load];
      this.find('.picked-load').textContent = report.header.loads[this.load].name;
      const safety = report.friction && mu > 0 ? `, safety ${number(report.friction / report.scaled(mu))}\u00d7` : '';
      this.find('.picked-mu').textContent = Number.isFinite(mu) ? `friction needed ${number(report.scaled(mu))}${safety}` : 'no slip limit';
    }
    const shown = this.load >= 0 ? this.load : worst;
    const stored = report.state(this.grip, shown) !== null;
    drawContact(this.find('.contact'), report, this.grip, '', shown);
    this.find('.under').textContent = stored ? `Under ${this.load >= 0 ? 'the chosen load' : 'the worst load'}: ${report.header.loads[shown].name}`
      : `Under the worst load: ${report.header.loads[worst].name}. Of the chosen load only the friction was stored.`;
    this.onLoad?.(shown, stored ? report.state(this.grip, shown) : report.state(this.grip));
  }

  /** A load's name without the words that all loads begin with. */
  shortName(load) {
    const { loads } = this.report.header;
    this.prefix ??= loads.length < 2 ? 0 : loads.reduce((common, { name }) => {
      while (!name.startsWith(common)) common = common.slice(0, -1);
      return common;
    }, loads[0].name).search(/\S*$/);
    return loads[load].name.slice(this.prefix) || loads[load].name;
  }

  full(i) {
    const { column: c } = this.report;
    const pose = this.report.pose(i);
    const wrench = c.wrench.subarray(6 * i, 6 * i + 6);
    const planes = this.report.state(i).plane(0) && [0, 1].map((face) => this.report.state(i).plane(face));
    const [lower, upper] = c.bounds.subarray(2 * i, 2 * i + 2);
    this.find('.full').replaceChildren(
      facts([
        ['Grip origin', vectorText(pose.origin, 1e3, 'mm')],
        ['Approach x\u2081', vectorText(pose.x1, 1, '').trim()],
        ['Closing x\u2083', vectorText(pose.x3, 1, '').trim()],
        ['Quaternion x, y, z, w', vectorText(quaternion(pose), 1, '').trim()],
        ['Force, grip frame', vectorText([...wrench.subarray(0, 3)], 1, 'N')],
        ['Moment, grip frame', vectorText([...wrench.subarray(3)], 1, 'N\u00b7m')],
        ['Pressure planes', planes ? `${number(planes[0][0] / 1e3)} and ${number(planes[1][0] / 1e3)}\u00a0kPa; slopes ${number(planes[0][1] / 1e6)}, ${number(planes[0][2] / 1e6)}\u00a0kPa/mm` : null],
        ['Bounds on friction', Number.isFinite(lower) ? `${number(lower, 6)} to ${Number.isFinite(upper) ? number(upper, 6) : 'open'}` : null],
        ['Residual', number(c.residual[i], 2)],
      ]),
    );
  }
}
