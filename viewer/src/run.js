// What was proposed and why the others fell, the part, the gripper, settings and provenance.

import { chosen, count, mass, mm, number, percent } from './format.js';
import { reasonBars, reasons } from './why.js';

export const node = (name, text, attributes = {}) => {
  const made = document.createElement(name);
  if (text !== undefined) made.textContent = text;
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
};

/** A definition list of `[name, value]`; entries without a value are left out. */
export function facts(entries, className = 'facts') {
  const list = node('dl', undefined, { class: className });
  for (const [name, value] of entries) {
    if (value === null || value === undefined) continue;
    const pair = node('div');
    const held = node('dd');
    if (value instanceof Node) held.append(value);
    else held.textContent = value;
    pair.append(node('dt', name), held);
    list.append(pair);
  }
  return list;
}

export function bars(entries, total, label) {
  const table = node('table', undefined, { class: 'bars' });
  table.append(node('caption', label, { class: 'hidden' }));
  const largest = Math.max(1, ...entries.map((entry) => entry[1]));
  for (const [name, value, kind, colour] of entries) {
    const row = node('tr');
    const bar = node('span', undefined, { class: `bar ${kind ?? ''}` });
    bar.style.width = `${(100 * value) / largest}%`;
    const held = node('td', undefined, { class: 'track' });
    held.append(bar);
    const title = node('th', name, { scope: 'row' });
    if (colour) title.prepend(node('span', undefined, { class: 'reason', style: `background:${colour}`, 'aria-hidden': 'true' }));
    row.append(title, held, node('td', count(value), { class: 'number' }), node('td', total ? percent(value / total) : '', { class: 'number share' }));
    table.append(row);
  }
  return table;
}

const section = (title, ...content) => {
  const made = node('section');
  made.append(node('h3', title), ...content);
  return made;
};

const plain = (value) => (typeof value === 'string' ? value : typeof value === 'number' ? chosen(value) : JSON.stringify(value));
const size = (low, high) => high.map((v, k) => number((v - low[k]) * 1e3)).join(' \u00d7 ') + '\u00a0mm';

/** Sentences about what the page does not show in full. */
export function limits(report) {
  const { display, grips, gripper, gripper_problem: problem, by_load: byLoad, loads, obstacles, provenance } = report.header;
  const notes = (provenance.warnings ?? []).map((text) => `Warning: ${text}`);
  if (!display) notes.push('The part\u2019s mesh was not given: its bounding box is drawn.');
  else if (display.shown < display.triangles) {
    notes.push(`Part simplified for display: ${count(display.shown)} of ${count(display.triangles)} triangles, ${display.deviation < 1e-6 ? 'less than 0.001\u00a0mm' : `at most about ${mm(display.deviation, 2)}`} off. Scores come from the full part.`);
  }
  if (grips.shown < grips.total) notes.push(`The best ${count(grips.shown)} of ${count(grips.total)} grips are listed.`);
  if (obstacles.problem) notes.push(`The scene could not be drawn: ${obstacles.problem}.`);
  if (!gripper) notes.push(`The gripper could not be drawn: ${problem}.`);
  if (byLoad.rows > 0 && byLoad.rows < grips.shown && loads.length > 1) notes.push(`The friction over all loads was solved for ${count(byLoad.rows)} of the grips, the best ones first; for the others only the worst load.`);
  return notes;
}

export function drawRun(root, report) {
  const { header } = report;
  const { summary, part, gripper, provenance, display } = header;
  const rejections = reasons(report);
  const fallen = rejections.reduce((sum, entry) => sum + (entry.pairs ? 0 : entry.n), 0);
  const funnel = bars([['Candidates', summary.candidates], ['Rejected', fallen, 'bad'], ['Ranked', summary.ranked, 'good'], ...(summary.holding === undefined ? [] : [['Hold', summary.holding, 'good']])], summary.candidates, 'From candidates to ranked grips');
  root.append(section('From candidates to grips', node('p', `${count(summary.pairs)} pair${summary.pairs === 1 ? '' : 's'} of opposite faces within the stroke.`, { class: 'quiet' }), funnel));
  root.append(section('Why candidates were rejected', ...(rejections.length ? reasonBars(rejections) : [node('p', 'None was rejected.', { class: 'quiet' })])));
  if (provenance.warnings?.length) root.append(section('Warnings', ...provenance.warnings.map((text) => node('p', text))));
  const com = part.mass.centre_of_mass.map((v) => number(v * 1e3)).join(', ');
  root.append(
    section('Part', facts([
      ['File', part.file.split(/[\\/]/).pop()], ['Size', size(part.bbox_min, part.bbox_max)], ['Mass', mass(part.mass.mass)], ['Volume', `${number(part.mass.volume * 1e6)}\u00a0cm\u00b3`],
      ['Centre of mass', `(${com})\u00a0mm`], ['Triangles', count(part.triangles)], ['Shown', display ? count(display.shown) : 'bounding box'], ['File unit', `${chosen(part.unit_m * 1e3)}\u00a0mm`],
    ])),
  );
  if (gripper) {
    const pad = [0, 1].map((k) => gripper.pad.map((p) => p[k]));
    const [x, y] = pad.map((values) => chosen((Math.max(...values) - Math.min(...values)) * 1e3));
    root.append(
      section('Gripper', facts([
        ['Name', gripper.name], ['Stroke', `${chosen(gripper.stroke[0] * 1e3)} to ${chosen(gripper.stroke[1] * 1e3)}\u00a0mm`], ['Force per jaw', `${chosen(gripper.force[0])} to ${chosen(gripper.force[1])}\u00a0N`],
        ['Payload', gripper.payload ? mass(gripper.payload) : null], ['Moments', gripper.moment ? `${gripper.moment.map((v) => chosen(v)).join(', ')}\u00a0N\u00b7m` : null],
        ['Pad (x\u2081 \u00d7 x\u2082)', `${x} \u00d7 ${y}\u00a0mm`], ['Pad friction', report.friction ? chosen(report.friction) : 'not stated'],
        ['Rubber', gripper.pad_thickness === null ? 'not stated' : `${chosen(gripper.pad_thickness * 1e3)}\u00a0mm`],
      ])),
    );
  }
  root.append(section('Settings', node('p', 'As asked for, and what was used where nothing was.', { class: 'quiet' }), facts(Object.entries(provenance.settings).map(([name, value]) => [name, plain(value)]), 'facts settings')));
  root.append(section('Provenance', facts([['gripfast', provenance.gripfast], ['Backend', provenance.backend], ['Loads', count(header.loads.length)]]), node('pre', provenance.command.join(' '), { tabindex: '0', 'aria-label': 'Command line' })));
  const notes = limits(report);
  notes.push('Keys: arrows, Page Up and Page Down, Home and End choose in the list; / goes to the search; M marks the chosen grip; in the view arrows turn, shift with arrows moves, plus and minus zoom, F shows the whole part, A the gripper too, G the grip, P plays its approach; on the load ball arrows go from load to load. A click on a dot chooses its grip.');
  root.append(section('About this page', ...notes.map((text) => node('p', text, { class: 'quiet' }))));
  root.append(node('p', 'Three-dimensional view: three.js, MIT licence, \u00a9 three.js authors. This page loads nothing from the network.', { class: 'quiet' }));
}
