// How the part would begin to move: it slides, turns about a place in the pads' plane, or spins or rolls about an axis of its own.

/** Share of the motion below which its turning, or its sliding along an axis, is not told. */
const LEAST = 0.02;

/** Half of what the pads of grip `i` reach, along them or from one to the other [m]. */
function reachOf(report, i) {
  const pad = report.header.gripper?.pad ?? report.contact(i).flatMap(({ points }) => points);
  return Math.max(report.column.width[i] / 2, ...pad.map(([x, y]) => Math.hypot(x, y)));
}

/**
 * The motion of grip `i` that the slip record `slip` stands for, in the grip's frame:
 * `{ type: 'slides', direction }`, `{ type: 'turns', axis, foot }`, `{ type: 'spins' | 'rolls', axis, foot, pitch, on }`,
 * or a type alone: `none`, `unknown`. `axis` is a unit vector about which it turns by the right hand, `foot` its point nearest to the
 * grip's middle [m], `pitch` the way along the axis [m/rad], `on` the pad on which it rolls. A turn about a place so far
 * off that all of the contact moves alike is told as sliding.
 */
export function motionOf(report, i, slip) {
  const reach = reachOf(report, i);
  const unit = (v) => v.map((value) => value / Math.hypot(...v));
  if (slip.type === 'translation') return { type: 'slides', direction: [...slip.direction, 0] };
  if (slip.type === 'rotation') {
    const [x, y] = slip.c;
    if (reach < LEAST * Math.hypot(x, y)) return { type: 'slides', direction: unit([slip.sense * y, -slip.sense * x, 0]) };
    return { type: 'turns', axis: [0, 0, slip.sense], foot: [x, y, 0] };
  }
  if (slip.type !== 'spin') return { type: slip.type };
  const [o1, o2, o3] = slip.omega;
  const [u1, u2] = slip.velocity;
  const rate = Math.hypot(o1, o2, o3);
  if (rate * reach < LEAST * Math.hypot(u1, u2)) return { type: 'slides', direction: unit([u1, u2, 0]) };
  const pitch = (o1 * u1 + o2 * u2) / rate ** 2;
  return {
    type: slip.rolls ? 'rolls' : 'spins', on: slip.rolls, axis: unit([o1, o2, o3]),
    foot: [-o3 * u2, o3 * u1, o1 * u2 - o2 * u1].map((v) => v / rate ** 2),
    pitch: Math.abs(pitch) < LEAST * reach ? 0 : pitch,
  };
}
