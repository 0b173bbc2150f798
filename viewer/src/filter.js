// Which grips are listed, and in which order.

import { verdict } from './detail.js';
import { words } from './format.js';

/** Sort keys: name shown, value of a grip (smaller first), and the direction that puts the good ones on top. */
export function sortKeys(report) {
  const c = report.column;
  const missing = (value) => (Number.isFinite(value) ? value : Infinity);
  return {
    // Asked what if, those that hold come first, and at another force the score is another.
    rank: { name: 'Rank', value: (i) => (report.changed ? (report.estimate ? -Math.min(report.score(i), 1e30) : c.rank[i]) + (verdict(report, i)[1] === 'bad' ? 1e31 : 0) : c.rank[i]), best: 1 },
    mu: { name: 'Friction needed', value: (i) => missing(c.mu[i]), best: 1 },
    safety: { name: 'Safety', value: (i) => -missing(c.mu[i]), best: -1 },
    squeeze: { name: 'Squeeze force', value: (i) => missing(c.force_needed[i]), best: 1 },
    width: { name: 'Width', value: (i) => c.width[i], best: 1 },
    faces: { name: 'Face pair', value: (i) => c.face_i[i] * 65536 + c.face_ii[i], best: 1 },
    alpha: { name: 'Self-aligning tilt', value: (i) => c.alpha[i], best: -1 },
    margin: { name: 'Twist-out margin', value: (i) => c.twist_margin[i], best: -1 },
    share: { name: 'Contact left', value: (i) => c.contact_share[i], best: -1 },
    cover: { name: 'Pad covered', value: (i) => report.cover(i), best: -1 },
    pressure: { name: 'Largest pressure', value: (i) => missing(report.largestPressure(i)), best: 1 },
  };
}

export const pairName = (report, i) => `${report.column.face_i[i]}\u2009/\u2009${report.column.face_ii[i]}`;

export const EMPTY = { low: -Infinity, high: Infinity, pair: '', status: '', text: '', approach: '', cover: '', pressure: '', narrow: '', wide: '', safety: '', turns: '' };

/** Directions within this angle of an axis count as along it. */
const ALONG = Math.cos(Math.PI / 4);

/** Approaches to choose from: `[value, name]`. */
export const APPROACHES = ['x', 'y', 'z'].flatMap((axis) => ['-', '+'].map((sign) => [`${sign}${axis}`, `Approach along ${sign === '-' ? '\u2212' : '+'}${axis}${axis === 'z' ? (sign === '-' ? ', from above' : ', from below') : ''}`]));

/** Face pairs with their number of grips, most grips first. */
export function pairs(report) {
  const counts = new Map();
  for (let i = 0; i < report.n; i++) {
    const key = `${report.column.face_i[i]}/${report.column.face_ii[i]}`;
    counts.set(key, (counts.get(key) ?? 0) + 1);
  }
  return [...counts].sort((a, b) => b[1] - a[1]);
}

let haystack;
function searchable(report) {
  haystack ??= Array.from({ length: report.n }, (_, i) => {
    const c = report.column;
    return `#${c.rank[i]} id ${c.id[i]} faces ${c.face_i[i]}/${c.face_ii[i]} ${words(report.status(i))} ${verdict(report, i)[0]} ${report.load(i).name}`.toLowerCase();
  });
  return haystack;
}

/** Indices of the grips that pass `filter`, sorted. */
export function select(report, filter, key, direction) {
  const { mu, status } = report.column;
  const [faceI, faceII] = filter.pair ? filter.pair.split('/').map(Number) : [];
  const kind = filter.status.startsWith('kind:') ? filter.status.slice(5) : '';
  const wanted = filter.status && !kind ? report.header.statuses.indexOf(filter.status) : -1;
  const limit = (name, factor, otherwise) => (filter[name] === '' || !Number.isFinite(Number(filter[name])) ? otherwise : Number(filter[name]) * factor);
  const [cover, pressure, safety] = [limit('cover', 1e-2, null), limit('pressure', 1e3, null), limit('safety', 1, null)];
  const [narrow, wide] = [limit('narrow', 1e-3, -Infinity) - 1e-9, limit('wide', 1e-3, Infinity) + 1e-9];
  const axis = 'xyz'.indexOf(filter.approach[1]);
  const sign = filter.approach[0] === '-' ? -1 : 1;
  const tokens = filter.text.toLowerCase().split(/\s+/).filter(Boolean);
  const texts = tokens.length ? searchable(report) : null;
  const open = filter.low === -Infinity && filter.high === Infinity;
  const chosen = [];
  for (let i = 0; i < report.n; i++) {
    if (!open && !(mu[i] >= filter.low && mu[i] <= filter.high)) continue;
    if (filter.pair && !(report.column.face_i[i] === faceI && report.column.face_ii[i] === faceII)) continue;
    if (wanted >= 0 && status[i] !== wanted) continue;
    if (kind && (verdict(report, i)[1] === 'bad') !== (kind === 'bad')) continue;
    if (filter.turns && report.column.turn_of[i] !== report.column.id[i]) continue;
    if (axis >= 0 && sign * report.column.rotation[9 * i + axis] < ALONG - 1e-6) continue;
    if (report.column.width[i] < narrow || report.column.width[i] > wide) continue;
    if (safety !== null && !(report.column.mu[i] === 0 || report.safety(i) >= safety)) continue;
    if (cover !== null && !(report.cover(i) >= cover)) continue;
    if (pressure !== null && !(report.largestPressure(i) <= pressure)) continue;
    if (texts && !tokens.every((token) => texts[i].includes(token))) continue;
    chosen.push(i);
  }
  const value = sortKeys(report)[key].value;
  const values = Float64Array.from({ length: report.n }, (_, i) => value(i));
  const compare = (a, b) => (values[a] === values[b] ? a - b : direction * (values[a] < values[b] ? -1 : 1));
  return chosen.sort(compare);
}
