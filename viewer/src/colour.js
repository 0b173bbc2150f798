// Colour scales. mu_s: blue (little friction needed) to red (much), lightness-balanced so that both ends stand out on
// light and dark grounds and stay apart for colour-blind readers. Pressure: one hue family, dark to light.

const hex = (list) => list.map((text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16)));
const FRICTION = hex(['#2468b4', '#4d9bd0', '#9ccbd8', '#f0d693', '#ee9a5b', '#d5523e', '#a51d2d']);
const PRESSURE = hex(['#1d2a5c', '#1f5a8c', '#1a8c96', '#4bb983', '#b5d856', '#fbe84f']);
/** Loads without a limit state. */
export const NO_LIMIT = [138, 43, 150];

function ramp(stops, t) {
  const x = Math.min(Math.max(t, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(x), stops.length - 2);
  return stops[i].map((from, k) => from + (stops[i + 1][k] - from) * (x - i));
}

export const friction = (t) => ramp(FRICTION, t);
export const pressure = (t) => ramp(PRESSURE, t);
/** Colours of reasons, told apart by the colour-blind too (Okabe and Ito 2008); what is left is grey. */
export const REASONS = ['#d55e00', '#0072b2', '#e69f00', '#009e73', '#cc79a7', '#56b4e9', '#f0e442'];

/** What stops a rejected candidate. */
export const HIT = '#c8102e';

/** The colour of a reason for which candidates were rejected. */
export function reasonColour(report, name) {
  const place = report.header.reasons.filter((reason) => !reason.startsWith('face_pair')).indexOf(name);
  return REASONS[place] ?? '#8a8f98';
}

export const css = (rgb) => `rgb(${rgb.map(Math.round).join(' ')})`;
export const gradient = (scale, steps = 12) =>
  `linear-gradient(to right, ${Array.from({ length: steps + 1 }, (_, i) => css(scale(i / steps))).join(', ')})`;

/** Maps mu_s to 0..1 between the best and the 95th percentile, so that a few hopeless grips do not flatten the rest. */
export function frictionScale(values) {
  const sorted = Float32Array.from(values.filter(Number.isFinite)).sort();
  if (sorted.length === 0) return { low: 0, high: 1, most: 1, at: () => 1 };
  const low = sorted[0];
  const high = Math.max(sorted[Math.ceil((sorted.length - 1) * 0.95)], low * 1.0001 + 1e-9);
  return { low, high, most: sorted.at(-1), at: (mu) => (Number.isFinite(mu) ? (mu - low) / (high - low) : 1) };
}
