// Distribution of mu_s over the grips, which is also the range filter.

import { count, number } from './format.js';
import { css, friction } from './colour.js';

const BINS = 40;
const SVG = 'http://www.w3.org/2000/svg';

/** Draws into `root` (an svg, two range inputs, an output) and calls `change(low, high)`. */
export class Histogram {
  constructor(root, report, scale, change) {
    this.root = root;
    this.mu = report.column.mu;
    const finite = Float32Array.from(this.mu).filter(Number.isFinite).sort();
    // A long tail goes into the last bin: the ranking's good end deserves the width.
    this.low = finite[0] ?? 0;
    this.high = Math.max(finite[Math.floor((finite.length - 1) * 0.98)] ?? 1, this.low * 1.001 + 1e-9);
    this.tail = finite.length > 0 && finite[finite.length - 1] > this.high;
    this.scale = scale;
    this.missing = this.mu.length - finite.length;
    [this.from, this.to] = root.querySelectorAll('input');
    this.output = root.querySelector('output');
    this.svg = root.querySelector('svg');
    this.svg.setAttribute('viewBox', `0 0 ${BINS} 100`);
    this.svg.setAttribute('preserveAspectRatio', 'none');
    this.bars = Array.from({ length: BINS }, (_, i) => {
      const bar = document.createElementNS(SVG, 'rect');
      bar.setAttribute('x', i + 0.06);
      bar.setAttribute('width', 0.88);
      bar.style.fill = css(friction(scale.at(this.value((i + 0.5) / BINS))));
      this.svg.append(bar);
      return bar;
    });
    this.all = this.bins(null);
    const input = () => {
      if (Number(this.from.value) > Number(this.to.value)) [this.from.value, this.to.value] = [this.to.value, this.from.value];
      this.label();
      change(...this.range());
    };
    this.from.addEventListener('input', input);
    this.to.addEventListener('input', input);
    this.draw(null);
    this.label();
  }

  value(t) {
    return this.low + t * (this.high - this.low);
  }

  /** Chosen range; an end slider at its stop sets no limit. */
  range() {
    const [a, b] = [Number(this.from.value) / 100, Number(this.to.value) / 100];
    return [a <= 0 ? -Infinity : this.value(a), b >= 1 ? Infinity : this.value(b)];
  }

  /** Whether to say that the bars stand for the planned force, while the list shows another. */
  setPlanned(planned) {
    this.planned = planned;
    this.label();
  }

  reset() {
    this.from.value = 0;
    this.to.value = 100;
    this.label();
  }

  bins(chosen) {
    const bins = new Uint32Array(BINS);
    const put = (mu) => {
      if (Number.isFinite(mu)) bins[Math.min(BINS - 1, Math.max(0, Math.floor(((mu - this.low) / (this.high - this.low)) * BINS)))]++;
    };
    if (chosen) chosen.forEach((i) => put(this.mu[i]));
    else this.mu.forEach(put);
    return bins;
  }

  /** Bars of the listed grips (null: all). */
  draw(chosen) {
    const bins = chosen ? this.bins(chosen) : this.all;
    const top = Math.max(1, ...this.all);
    bins.forEach((n, i) => {
      // Square root: single good grips stay visible beside a crowd of poor ones.
      const height = n ? Math.max(3, 100 * Math.sqrt(n / top)) : 0;
      this.bars[i].setAttribute('y', 100 - height);
      this.bars[i].setAttribute('height', height);
    });
  }

  label() {
    const [low, high] = this.range();
    const words = low === -Infinity && high === Infinity ? 'all' : `${low === -Infinity ? number(this.low) : number(low)} to ${high === Infinity ? 'largest' : number(high)}`;
    this.output.textContent = this.planned ? `${words}, at the planned force` : words;
    this.from.setAttribute('aria-valuetext', number(this.value(this.from.value / 100)));
    this.to.setAttribute('aria-valuetext', high === Infinity ? 'no limit' : number(high));
    const [min, max] = this.root.querySelectorAll('.ends span');
    min.textContent = number(this.low);
    max.textContent = `${this.tail ? '\u2265\u2009' : ''}${number(this.high)}`;
    const tail = this.missing ? `; ${count(this.missing)} without a slip limit` : '';
    this.svg.setAttribute('aria-label', `Histogram of the friction needed, ${number(this.low)} to ${number(this.high)}${tail}`);
  }
}
