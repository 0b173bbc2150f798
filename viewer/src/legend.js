// What the colours and signs of the view mean.

import { friction, gradient, pressure, reasonColour } from './colour.js';
import { number } from './format.js';
import { node } from './run.js';
import { reason } from './why.js';

/** Writes the entries into `list`; `colours` are those of the view now. */
export function drawLegend(list, report, scale, colours) {
  const { gripper, asked } = report.header;
  const grips = report.n > 0;
  const entries = [
    grips && ['bar', gradient(friction), `Pad centre, friction needed ${number(scale.low)} to ${number(scale.high)}: a disc holds, a cross slips`],
    ['box', colours.part, 'Part'],
    gripper && ['box', colours.jaw, 'Gripper'],
    gripper && ['box', colours.pad, grips ? 'Pads, and where they touch' : 'Pads'],
    gripper && ['line', colours.approach, 'Approach'],
    grips && report.column.surface_rings.length > 1 && ['bar', gradient(pressure), 'Round faces: pressure from none to the largest'],
    grips && ['line', colours.load, 'Load at the centre of mass: force, and moment as a turning arrow'],
    gripper && grips && ['line', colours.ghost, 'Pinned gripper, in outline'],
    gripper?.flange && ['axes', '', 'Flange frame, axes x, y, z'],
    asked.ground && ['box', colours.fixture, 'Ground'],
    asked.keep_out?.length > 0 && ['box', colours.fixture, 'Boxes to keep out of'],
    report.header.obstacles.list.length > 0 && ['box', colours.fixture, `Obstacles of the scene: ${report.header.obstacles.list.map(({ name }) => name).join('; ')}`],
    ...report.header.reasons.filter((name) => !name.startsWith('face_pair')).map((name) => ['box', reasonColour(report, name), `Rejected: ${reason(name, report).title.toLowerCase()}`]),
  ];
  list.replaceChildren(...entries.filter(Boolean).map(([kind, colour, text]) => {
    const item = node('li');
    const sign = node('span', kind === 'axes' ? 'xyz' : undefined, { class: `sign ${kind}`, 'aria-hidden': 'true' });
    if (colour) sign.style.background = colour;
    item.append(sign, text);
    return item;
  }));
}
