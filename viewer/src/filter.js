// Which grips are listed, and in which order.

import { verdict } from './detail.js';
import { words } from './format.js';

/** Sort keys: name shown, value of a grip (smaller first), and the direction that puts the good ones on top. */
export function sortKeys(report) {
  const c = report.column;
  const missing = (value) => (Number.isFinite(value) ? value : Infinity);
  return {
    rank: { name: 'Rank', value: (i) => c.rank[i], best: 1 },
    mu: { name: 'Friction needed', value: (i) => missing(c.mu[i]), best: 1 },
    squeeze: { name: 'Squeeze force', value: (i) => missing(c.force_needed[i]), best: 1 },
    width: { name: 'Width', value: (i) => c.width[i], best: 1 },
    faces: { name: 'Face pair', value: (i) => c.face_i[i] * 65536 + c.face_ii[i], best: 1 },
    alpha: { name: 'Self-aligning tilt', value: (i) => c.alpha[i], best: -1 },
    margin: { name: 'Twist-out margin', value: (i) => c.twist_margin[i], best: -1 },
    share: { name: 'Contact left', value: (i) => c.contact_share[i], best: -1 },
  };
}

export const pairName = (report, i) => `${report.column.face_i[i]}\u2009/\u2009${report.column.face_ii[i]}`;

export const EMPTY = { low: -Infinity, high: Infinity, pair: '', status: '', text: '' };

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
  const wanted = filter.status ? report.header.statuses.indexOf(filter.status) : -1;
  const tokens = filter.text.toLowerCase().split(/\s+/).filter(Boolean);
  const texts = tokens.length ? searchable(report) : null;
  const open = filter.low === -Infinity && filter.high === Infinity;
  const chosen = [];
  for (let i = 0; i < report.n; i++) {
    if (!open && !(mu[i] >= filter.low && mu[i] <= filter.high)) continue;
    if (filter.pair && !(report.column.face_i[i] === faceI && report.column.face_ii[i] === faceII)) continue;
    if (wanted >= 0 && status[i] !== wanted) continue;
    if (texts && !tokens.every((token) => texts[i].includes(token))) continue;
    chosen.push(i);
  }
  const value = sortKeys(report)[key].value;
  const values = Float64Array.from({ length: report.n }, (_, i) => value(i));
  const compare = (a, b) => (values[a] === values[b] ? a - b : direction * (values[a] < values[b] ? -1 : 1));
  return chosen.sort(compare);
}
