// What if the pads had another friction, the gripper another force, or more safety were asked for?

import { chosen, newtons } from './format.js';
import { copy } from './take.js';

/** Runs the sliders in `root` and calls `change()` after every move; the numbers are in `report.now`. */
export function whatIf(root, report, change) {
  const { planned } = report;
  const { gripper } = report.header;
  const ranges = {
    friction: [Math.min(0.05, planned.friction ?? 1), Math.max(1.2, 2 * (planned.friction ?? 0)), planned.friction ?? 0.5, (value) => chosen(value, 3)],
    force: planned.force ? [Math.min(gripper?.force[0] || planned.force / 10, planned.force / 10), Math.max(gripper?.force[1] ?? 0, 2 * planned.force), planned.force, (value) => newtons(value)] : null,
    safety: [Math.min(1, planned.safety), Math.max(5, 2 * planned.safety), planned.safety, (value) => `${chosen(value, 3)}\u00d7`],
  };
  const rows = [...root.querySelectorAll('[data-what]')].map((row) => {
    const name = row.dataset.what;
    row.hidden = !ranges[name];
    const [low, high, start, words] = ranges[name] ?? [0, 1, 0, String];
    const [input, output] = [row.querySelector('input'), row.querySelector('output')];
    // Steps of equal ratio: a force goes from 2 N to 500 N.
    const value = (place) => low * (high / low) ** (place / 1000);
    const place = (at) => (1000 * Math.log(at / low)) / Math.log(high / low);
    const show = () => {
      const text = report.now[name] === null ? 'not stated' : words(report.now[name]);
      output.textContent = text;
      input.setAttribute('aria-valuetext', text);
    };
    const reset = () => {
      input.value = place(start);
      report.now[name] = planned[name];
      show();
    };
    input.addEventListener('input', () => {
      // Two digits are enough for a guess; the planned value is caught again exactly.
      const raw = value(Number(input.value));
      const near = planned[name] && Math.abs(Math.log(raw / planned[name])) < Math.log(high / low) * 0.012;
      report.now[name] = near ? planned[name] : Number(raw.toPrecision(2));
      show();
      tell();
      change();
    });
    reset();
    return reset;
  });
  const [note, again, button] = ['.what-note', '.what-command', '.what-reset'].map((name) => root.querySelector(name));
  function tell() {
    const { now } = report;
    const friction = now.friction !== planned.friction;
    button.disabled = !report.changed;
    note.textContent = report.estimate
      ? 'Friction needed at another force: an estimate (\u2248), in proportion to load over force. It is exact only where no load presses, pulls or tilts the pads. For exact numbers make a new run with the command copied here.'
      : friction || now.safety !== planned.safety ? 'Exact for holds and slips: the friction needed does not depend on the pads. A squeeze force marked \u2248 is an estimate.' : 'As planned.';
    again.disabled = !report.estimate;
    again.title = report.estimate ? command(report) : '';
  }
  again.addEventListener('click', () => copy(again.title, again));
  button.addEventListener('click', () => {
    rows.forEach((reset) => reset());
    tell();
    change();
  });
  tell();
  root.querySelector('.what-sliders').hidden = report.n === 0;
}

/** The command line of this result with the force, and the friction, that are shown. */
function command(report) {
  const { now, planned, header } = report;
  const quote = (word) => (/^[\w./:=+,@%-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
  const drop = new Set(['--force', ...(now.friction === planned.friction ? [] : ['--pad-friction']), ...(now.safety === planned.safety ? [] : ['--safety'])]);
  const words = [];
  const given = header.provenance.command;
  for (let k = 0; k < given.length; k++) {
    if (drop.has(given[k])) k++;
    else if (![...drop].some((flag) => given[k].startsWith(`${flag}=`))) words.push(k === 0 ? 'gripfast' : quote(given[k]));
  }
  words.push('--force', `${now.force}N`);
  if (now.friction !== planned.friction && now.friction) words.push('--pad-friction', String(now.friction));
  if (now.safety !== planned.safety) words.push('--safety', String(now.safety));
  return words.join(' ');
}
