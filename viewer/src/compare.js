// Two grips side by side: the pinned one and the chosen one.

import { drawContact } from './contact.js';
import { verdict } from './detail.js';
import { count, degrees, mm, newtons, NONE, number, percent, pressureUnit } from './format.js';
import { node } from './run.js';

const pressureText = (value) => {
  const [unit, name] = pressureUnit(value);
  return Number.isFinite(value) ? `${number(value / unit)}\u00a0${name}` : NONE;
};

/** What two grips are compared in: name, text of a grip, its value, and the direction that is better (0: neither). */
function rows(report) {
  const c = report.column;
  return [
    ['Verdict', (i) => verdict(report, i)[0], null, 0],
    ['Friction needed', (i) => number(report.mu(i)), (i) => report.mu(i), -1],
    ['Safety', (i) => (Number.isFinite(report.safety(i)) ? `${number(report.safety(i))}\u00d7` : NONE), (i) => report.safety(i), 1],
    ['Squeeze needed', (i) => newtons(report.squeeze(i)), (i) => report.squeeze(i), -1],
    ['Width', (i) => mm(c.width[i]), null, 0],
    ['Pad covered', (i) => percent(report.cover(i)), (i) => report.cover(i), 1],
    ['Contact left', (i) => percent(c.contact_share[i]), (i) => c.contact_share[i], 1],
    ['Largest pressure', (i) => pressureText(report.largestPressure(i)), (i) => report.largestPressure(i), -1],
    ['Twist-out margin', (i) => percent(c.twist_margin[i]), (i) => c.twist_margin[i], 1],
    ['Self-aligning tilt', (i) => degrees(c.alpha[i]), (i) => c.alpha[i], 1],
    ['Faces', (i) => `${c.face_i[i]} and ${c.face_ii[i]}`, null, 0],
    ['Worst load', (i) => report.load(i).name, null, 0],
  ];
}

/** Shows `pinned` beside `chosen` in `root`; hides it without two different grips. */
export function drawCompare(root, report, pinned, chosen) {
  root.hidden = pinned < 0;
  if (pinned < 0) return;
  const c = report.column;
  const table = root.querySelector('table');
  table.replaceChildren(node('caption', pinned === chosen ? 'Choose another grip to see it beside this one.' : 'The better value of each row is marked.'));
  const head = table.createTHead().insertRow();
  head.append(node('td', ''), ...[pinned, chosen].map((i, k) => node('th', `${k ? 'Chosen' : 'Pinned'}: grip ${count(c.rank[i])}`, { scope: 'col' })));
  const body = table.createTBody();
  for (const [name, text, value, better] of rows(report)) {
    const row = body.insertRow();
    row.append(node('th', name, { scope: 'row' }));
    const values = value && [pinned, chosen].map((i) => better * value(i));
    // What reads the same is not better.
    const differ = text(pinned) !== text(chosen);
    [pinned, chosen].forEach((i, k) => {
      const cell = row.insertCell();
      cell.textContent = text(i);
      const best = values && differ && values[k] > values[1 - k] + 1e-6 * Math.abs(values[k]);
      if (best) cell.append(node('span', ' \u2713', { class: 'best', 'aria-label': ', better' }));
    });
  }
  drawContact(root, report, pinned, 'pinned-');
}
