// Why no grip was found, or none holds: the reasons as bars, what each one means, and what would help.

import { reasonColour } from './colour.js';
import { verdict } from './detail.js';
import { chosen, count, degrees, inMm, mm, newtons, number, percent, words } from './format.js';
import { bars, node } from './run.js';

const upper = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** Sizes [m] that hardly any part has that a robot's gripper holds. */
const [TINY, HUGE] = [1e-3, 2];

const largestForce = (report) => Math.max(0, ...report.header.loads.map((load) => Math.hypot(...load.wrench.force)));

/** An element with `text`, its flags of the program set as code, which no line break cuts. */
function told(name, text) {
  const made = node(name);
  text.split(/(--[a-z-]+)/).forEach((piece, k) => made.append(k % 2 ? node('code', piece) : piece));
  return made;
}

/** Names of grippers of the catalogue that pass `test`, the one with the shortest stroke first; nothing where there is none. */
function others({ header }, test) {
  const fit = header.catalogue.filter((known) => known.name !== header.gripper?.name && test(known)).sort((a, b) => a.stroke[1] - b.stroke[1]);
  return fit.slice(0, 3).map(({ name, stroke, force }) => `${name} (${chosen(stroke[0] * 1e3)} to ${chosen(stroke[1] * 1e3)}\u00a0mm, up to ${newtons(force[1])})`).join(', ');
}

/** A gripper with another stroke, by name where the catalogue has one. */
function otherStroke(report) {
  const k = report.nearestMisses().get('face_pair_outside_stroke');
  const width = k === undefined ? NaN : report.miss(k).width;
  const known = others(report, ({ stroke }) => stroke[0] <= width && width <= stroke[1]);
  if (known) return `A gripper for ${mm(width)} (--gripper): ${known}.`;
  const size = report.header.part.bbox_max.map((high, n) => inMm(high - report.header.part.bbox_min[n])).join(' \u00d7 ');
  return `A gripper with another stroke (gripfast gripper list names those of the catalogue), or another unit of the part file (--unit): the part measures ${size}\u00a0mm.`;
}

/** What to do about a force that is too small. */
function moreForce(report) {
  const { asked, gripper } = report.header;
  const known = others(report, ({ stroke, force }) => force[1] > (gripper?.force[1] ?? Infinity) && stroke[1] >= (gripper?.stroke[1] ?? 0));
  const stronger = known ? ` Stronger ones of the catalogue: ${known}.` : '';
  if (gripper && asked.force < gripper.force[1]) return `More force: this gripper gives up to ${newtons(gripper.force[1])} (--force), and ${newtons(asked.force)} was asked for.`;
  return `More force than this gripper has${gripper ? ` (${newtons(gripper.force[1])})` : ''}: a stronger gripper, or a lighter part and gentler motion (--mass, --accel).${stronger}`;
}

/** A rejection in words: title, meaning, and advice. */
export function reason(name, report) {
  const { asked, gripper, part, loads } = report.header;
  const [kind, of] = name.split(':');
  const body = upper((of ?? '').replaceAll('_', ' '));
  const known = {
    face_pair_outside_stroke: () => {
      const size = part.bbox_max.map((high, k) => high - part.bbox_min[k]);
      const odd = Math.max(...size) > HUGE || Math.max(...size) < TINY;
      return ['Width outside the stroke', gripper ? `The faces lie nearer together or farther apart than the jaws reach (${chosen(gripper.stroke[0] * 1e3)} to ${chosen(gripper.stroke[1] * 1e3)}\u00a0mm).` : '',
        odd ? `Check the unit of the part file: the part measures ${size.map((v) => (v >= 1 ? count(v * 1e3) : inMm(v))).join(' \u00d7 ')}\u00a0mm (--unit).`
          : otherStroke(report)];
    },
    face_pair_not_chosen: () => ['Faces not chosen', 'The choice of faces leaves these pairs out.', 'More faces: --faces and --faces-in, or neither.'],
    approach_outside_cone: () => ['Approach outside the cone', 'The approach is not among the directions asked for.',
      asked.approach_cone ? `A wider cone: --approach allows ${degrees(asked.approach_cone.half_angle_rad)} about (${asked.approach_cone.axis.map((v) => number(v)).join(', ')}).` : 'A wider cone (--approach).'],
    too_far_from_centre_of_mass: () => ['Too far from the centre of mass', '', `A larger --max-offset${asked.max_offset ? ` than ${mm(asked.max_offset)}` : ''}.`],
    face_pair_opening_too_small: () => ['No room to open', 'At these widths the stroke does not leave the jaws the least opening asked for.', 'A smaller --min-opening, or a gripper that opens wider.'],
    pad_share_too_small: () => ['Too little of the pad touches', '', 'A smaller --min-pad-share, or smaller pads.'],
    contact_too_small: () => ['Contact too small', 'A pad would touch too little of its face.',
      `A smaller share (--min-contact${asked.min_contact ? `, now ${percent(asked.min_contact)}` : ''}), or a finer grid (--spacing${asked.spacing ? `, now ${mm(asked.spacing)}` : ''}).`],
    ground: () => [`${body} below the ground`, 'Drawn in the view: the ground that the gripper must stay above.',
      `A lower --ground${asked.ground ? ` than ${mm(asked.ground.height_m)}` : ''}, a part that stands higher, or an approach from above (--approach).`],
    keep_out: () => [`${body} in a box to keep out of`, 'The boxes are drawn in the view.', 'Smaller boxes (--keep-out), or another approach.'],
    scene: () => [`Stopped by the scene: ${(of ?? '').replaceAll('_', ' ')}`, 'The gripper meets this obstacle of the scene file (drawn in the view), or the robot does not get there.', 'Another place of the part in the cell, less clearance in the scene file, or another approach.'],
    part_interference: () => [`${body} runs into the part`, '', `Places between the obstacles, with a finer grid (--spacing, --angle-step)${asked.clearance ? ` or less clearance (--clearance, now ${mm(asked.clearance)})` : ''}; else a gripper with slimmer fingers.`],
    approach_blocked: () => [`${body} hits the part on its way in`, 'The pose itself is free; the opened jaws do not get there.', `A smaller --opening${asked.opening ? ` than ${mm(asked.opening)} per jaw` : ''}.`],
    no_normal_force: () => ['Pulled off a pad', `A load pulls along the closing axis so hard that one pad no longer presses. The largest of the ${count(loads.length)} loads is ${newtons(largestForce(report))}, the gripping force ${newtons(asked.force)}.`, moreForce(report)],
    twisted_out: () => ['Twisted out of the pads', `A load tilts the part out of the pads whatever their friction. The largest load is ${newtons(largestForce(report))}, the gripping force ${newtons(asked.force)}.`,
      `Larger pads, or places nearer to the centre of mass. ${moreForce(report)}`],
    separating: () => ['Pads lift off', 'Part of a pad lifts off under a load, and such grips were to be discarded.', 'Take the contact that is left: --separation solve.'],
    no_contact: () => ['No contact', 'A contact area is empty.', ''],
    over_payload: () => ['Over the payload', `A load is larger than the weight of the ${(of ?? '').replaceAll('_', '\u00a0')} that the gripper file states. The largest of the ${count(loads.length)} loads is ${newtons(largestForce(report))}.`, 'A stronger gripper, or a lighter part and gentler motion (--mass, --accel).'],
    over_moment: () => {
      const [axis, most] = (of ?? '').split('_');
      return [`Moment about ${axis} over the limit`, `A load turns the part about ${axis} at the pads with more than the ${most}\u00a0N\u00b7m that the gripper file states.`, 'Places nearer to the centre of mass (--max-offset), or a stronger gripper.'];
    },
    over_pressure: () => ['Pressure over the limit', `The squeeze alone would press a face with more than the ${(of ?? '').replaceAll('_', '\u00a0')} asked for.`, 'A smaller --force, larger or softer pads, or a larger --max-pressure.'],
    face_pair_leans_too_much: () => ['Faces lean too much', 'The two faces are not parallel, and lean by more than the layers of the pads take up.', 'Softer or thicker pads (pad.stiffness in the gripper file), or pads that align themselves.'],
    bore_too_narrow_for_pads: () => ['Bore too narrow', 'The pads are wider than the bore, so that their edges would touch first.', 'A gripper with narrower outer pads.'],
    not_chosen: () => ['Not among the ids asked for', '', 'More of them: --ids.'],
    duplicate: () => ['Same as another by symmetry', 'Another grip of the list stands for it.', ''],
    outranked: () => ['Behind the best ones kept', 'Bounds put it behind the grips that are listed.', ''],
  }[kind];
  const [title, meaning, help] = known?.() ?? [words(name), '', ''];
  return { title, meaning, help };
}

/** Reasons with their counts, most first. */
export const reasons = (report) => Object.entries(report.header.summary.rejections).sort((a, b) => b[1] - a[1]).map(([name, n]) => ({ name, n, pairs: name.startsWith('face_pair'), colour: report.header.reasons.includes(name) && !name.startsWith('face_pair') ? reasonColour(report, name) : null, ...reason(name, report) }));

/** The reasons as bars: those that count candidates, and those that count pairs of faces, which no candidate came of. */
export function reasonBars(list) {
  const tables = [[false, 'Candidates by the reason for which they fell'], [true, 'Pairs of faces by the reason for which they were left out']].map(([pairs, label]) => {
    const own = list.filter((entry) => entry.pairs === pairs);
    const total = own.reduce((sum, entry) => sum + entry.n, 0);
    if (own.length === 0) return [];
    const table = bars(own.map((entry) => [entry.title, entry.n, 'bad', entry.colour]), total, label);
    return pairs ? [node('p', 'Pairs of faces that were left out:', { class: 'quiet' }), table] : [table];
  });
  return tables.flat();
}

/** How far rejected candidate `k` is from a grip, in words. */
export function missWords(report, k) {
  const { reason: name, by, place, width, faces } = report.miss(k);
  const { gripper, asked } = report.header;
  const at = place ? ` at (${place.map((v) => inMm(v)).join(', ')})\u00a0mm` : '';
  const [kind, of] = name.split(':');
  const body = upper((of ?? '').replaceAll('_', ' '));
  const free = by > 0 ? `; about ${mm(by, 2)} beside it would be free` : '';
  const force = asked.force ? ` at ${newtons(asked.force)}` : '';
  const missing = by < 1e-3 ? 'less than 0.1\u00a0%' : percent(by);
  const words = {
    face_pair_outside_stroke: () => `faces ${faces[0]} and ${faces[1]} are ${mm(width)} apart, ${mm(by, 2)} ${width > (gripper?.stroke[0] ?? 0) ? 'more' : 'less'} than the jaws reach`,
    contact_too_small: () => `${missing} of the contact asked for is missing`,
    pad_share_too_small: () => `${missing} of the contact asked for is missing`,
    approach_outside_cone: () => `its approach lies ${degrees(by)} outside the cone`,
    too_far_from_centre_of_mass: () => `it lies ${mm(by, 2)} too far out`,
    ground: () => `${body} would reach ${mm(by, 2)} below the ground${at}`,
    part_interference: () => `${body} meets the part${at}${free}`,
    approach_blocked: () => `${body} meets the part on its way${at}${free}`,
    twisted_out: () => (by < 1 ? `it holds ${percent(1 - by)} of a load that tilts it out${force}` : `a load tilts the part out of its pads${force}`),
    no_normal_force: () => (by < 1 ? `it holds ${percent(1 - by)} of a load that pulls it off a pad${force}` : `a load pulls the part off a pad${force}`),
    keep_out: () => `${body} would enter a box to keep out of${at}${free}`,
    scene: () => `${body} stops it`,
  }[kind];
  return upper(words?.() ?? reason(name, report).title);
}

/** Whether there is something to explain: no grip at all, or none that holds. */
export function nothingHolds(report) {
  for (let i = 0; i < report.n; i++) if (verdict(report, i)[1] !== 'bad') return false;
  return true;
}

/** Advice where grips exist and all of them slip. */
function allSlip(report) {
  const { column: c, header } = report;
  const { asked, gripper } = header;
  const indices = [...Array(report.n).keys()];
  const smallest = (values) => indices.reduce((best, i) => (values[i] < (best < 0 ? Infinity : values[best]) ? i : best), -1);
  const [mu, force] = [smallest(c.mu), smallest(c.force_needed)];
  const help = [];
  const { safety } = report.planned;
  if (mu >= 0) help.push(`Pads with more friction: grip ${count(c.rank[mu])} needs ${number(c.mu[mu] * safety)}${safety === 1 ? '' : ` with the safety of ${chosen(safety)}`}, the pads have ${chosen(report.friction)}.`);
  if (force >= 0 && gripper) {
    const needed = c.force_needed[force];
    help.push(needed <= gripper.force[1] ? `More force: grip ${count(c.rank[force])} holds its worst load with ${newtons(needed)} (--force).`
      : `More force: grip ${count(c.rank[force])} would need ${newtons(needed)} for its worst load, the gripper has ${newtons(gripper.force[1])}.`);
  }
  const most = indices.reduce((best, i) => (c.load_multiple[i] > best ? c.load_multiple[i] : best), 0);
  if (most > 0 && most < 1) help.push(`Smaller loads: ${percent(most)} of the worst load is held, by less mass or acceleration.`);
  return { mu, force: asked.force, help };
}

/** The nearest miss of each reason in `list` with a button that shows it; null where none was stored. */
function nearestMisses(report, list, show) {
  const nearest = report.nearestMisses();
  const items = node('ul', undefined, { class: 'misses' });
  for (const entry of list.filter(({ name }) => nearest.has(name))) {
    const k = nearest.get(entry.name);
    const item = node('li', undefined, { 'data-miss': k });
    const button = node('button', 'Show', { type: 'button', 'aria-label': `Show the nearest miss: ${entry.title}`, 'aria-pressed': 'false' });
    button.addEventListener('click', () => show(k));
    const words = node('span');
    words.append(node('b', `${entry.title}: `), missWords(report, k));
    item.append(words, ...(show ? [button] : []));
    items.append(item);
  }
  return items.children.length ? items : null;
}

/** The rejected candidate that tells most: of the reason with most candidates the one that lacks least; -1 where none was stored. */
export function tellingMiss(report) {
  const nearest = report.nearestMisses();
  const first = reasons(report).find(({ name, pairs }) => nearest.has(name) && (!pairs || report.header.summary.candidates === 0));
  return first ? nearest.get(first.name) : -1;
}

/** Whether the part is smaller than the pads, as one is in a file of another unit than was taken. */
function tiny({ header: { part, gripper } }) {
  if (!gripper) return false;
  const pad = [0, 1].map((k) => Math.max(...gripper.pad.map((point) => point[k])) - Math.min(...gripper.pad.map((point) => point[k])));
  return Math.max(...part.bbox_max.map((high, k) => high - part.bbox_min[k])) < Math.min(...pad);
}

/** Writes the panel and answers with its headline, or null where grips hold. `show(k)` shows rejected candidate k; null without a view. */
export function drawWhy(root, report, show) {
  if (!nothingHolds(report)) return null;
  const { summary, gripper } = report.header;
  const list = reasons(report);
  const fallen = list.reduce((sum, entry) => sum + (entry.pairs ? 0 : entry.n), 0);
  const unit = report.n === 0 && tiny(report) ? 'The whole part is smaller than the pads: if its file is in another unit, state that (--unit).' : '';
  const advice = new Set([unit, ...list.map((entry) => entry.help)].filter(Boolean));
  let [title, lead] = ['No grip holds this part', ''];
  if (report.n > 0) {
    const slip = allSlip(report);
    title = report.n === 1 ? 'The one grip slips' : `All ${count(report.n)} grips slip`;
    lead = slip.mu >= 0 ? `The best of them needs a friction of ${number(report.column.mu[slip.mu] * report.planned.safety)}${report.planned.safety === 1 ? '' : ` with the safety of ${chosen(report.planned.safety)}`}; the pads have ${chosen(report.friction)}${Number.isFinite(slip.force) ? ` at ${newtons(slip.force)}` : ''}.` : '';
    advice.clear();
    slip.help.forEach((text) => advice.add(text));
    if (fallen) lead += ` ${count(fallen)} other candidates fell before that:`;
  } else if (summary.candidates === 0) {
    title = 'No two faces fit between the jaws';
    const pairs = list.reduce((sum, entry) => sum + (entry.pairs ? entry.n : 0), 0);
    lead = pairs ? `The part has ${pairs === 1 ? 'one pair' : `${count(pairs)} pairs`} of opposite faces; ${gripper?.name ?? 'the gripper'} can close on none of them, so nothing could be tried.`
      : `The part has no two flat faces opposite each other that ${gripper?.name ?? 'the gripper'} could close on, so nothing could be tried.`;
  } else {
    lead = `${count(summary.pairs)} pair${summary.pairs === 1 ? '' : 's'} of opposite faces, ${count(summary.candidates)} candidates, and each of them fell:`;
  }
  root.replaceChildren(node('h2', title, { class: 'why-title' }), told('p', lead));
  if (list.length) {
    root.append(...reasonBars(list));
    const meanings = node('dl', undefined, { class: 'meanings' });
    for (const entry of list.filter((entry) => entry.meaning)) meanings.append(node('dt', entry.title), told('dd', entry.meaning));
    if (meanings.children.length) root.append(meanings);
    const misses = nearestMisses(report, list, show);
    if (misses) root.append(node('h3', 'The nearest miss of each kind'), misses);
  }
  if (advice.size) {
    const items = node('ul');
    items.append(...[...advice].map((text) => told('li', text)));
    root.append(node('h3', 'What would help'), items);
  }
  if (summary.candidates > 0) {
    const hint = told('p', 'gripfast plan with --why X,Y,Z:APPROACH:CLOSING explains a single pose, test by test.');
    hint.className = 'quiet';
    root.append(hint);
  }
  return title;
}
