// What the colours and signs of the view mean.

import { friction, gradient, HIT, pressure, reasonColour } from './colour.js';
import { number } from './format.js';
import { node } from './run.js';
import { reason } from './why.js';

/** Writes the entries into `list`; `colours` are those of the view now. */
export function drawLegend(list, report, scale, colours) {
  const { gripper, asked } = report.header;
  const grips = report.n > 0;
  const entries = [
    grips && ['bar', gradient(friction), `Pad centre, friction needed ${number(scale.low)} to ${number(scale.high)}${scale.most > scale.high ? ' and more' : ''}: a disc holds, a cross slips`],
    ['box', colours.part, 'Part'],
    gripper && ['box clear', colours.jaw, 'Gripper'],
    gripper && ['box clear', colours.pad, 'Pads'],
    gripper && grips && ['box', colours.pad, 'Where the pads touch'],
    gripper && ['line', colours.approach, grips ? 'Approach, and the ways of the pads as the jaws close' : 'Approach'],
    grips && report.column.surface_rings.length > 1 && ['bar', gradient(pressure), 'Round faces: pressure from none to the largest'],
    grips && ['line', colours.load, 'Load at the centre of mass; a turning arrow is its moment'],
    grips && ['line', colours.motion, 'How the part would begin to slip'],
    gripper && grips && ['line', colours.ghost, 'Pinned gripper, in outline'],
    gripper?.flange && ['axes', '', 'Flange frame, axes x, y, z'],
    asked.ground && ['box clear', colours.fixture, 'Ground'],
    asked.keep_out?.length > 0 && ['box clear', colours.fixture, 'Boxes to keep out of'],
    report.header.obstacles.list.length > 0 && ['box clear', colours.fixture, `Obstacles of the scene: ${report.header.obstacles.list.map(({ name }) => name).join('; ')}`],
    report.misses > 0 && ['box', HIT, 'What stops a rejected candidate, and where'],
    ...report.header.reasons.filter((name) => !name.startsWith('face_pair')).map((name) => ['box', reasonColour(report, name), `Rejected: ${reason(name, report).title.toLowerCase()}`]),
  ];
  list.replaceChildren(...entries.filter(Boolean).map(([kind, colour, text]) => {
    const item = node('li');
    const sign = node('span', kind === 'axes' ? 'xyz' : undefined, { class: `sign ${kind}`, 'aria-hidden': 'true' });
    if (colour) sign.style.setProperty('--sign', colour);
    item.append(sign, text);
    return item;
  }));
}
