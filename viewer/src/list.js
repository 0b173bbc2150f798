// The ranked list: only the rows in sight exist, whatever the number of grips.

const ROW = 40;

/** A listbox over `count` rows. `fill(element, position)` writes one row; `choose(position)` is called on a choice. */
export class VirtualList {
  constructor(box, { fill, choose }) {
    this.box = box;
    this.fill = fill;
    this.choose = choose;
    this.count = 0;
    this.position = -1;
    this.rows = new Map();
    this.free = [];
    this.spacer = document.createElement('div');
    this.spacer.className = 'rows';
    this.spacer.setAttribute('role', 'presentation');
    box.append(this.spacer);
    box.addEventListener('scroll', () => this.draw(), { passive: true });
    box.addEventListener('keydown', (event) => this.key(event));
    box.addEventListener('click', (event) => {
      const row = event.target.closest('.row');
      if (row) this.choose(Number(row.dataset.position));
    });
    new ResizeObserver(() => this.draw()).observe(box);
  }

  /** New content; keeps no row. */
  reset(count, position) {
    this.count = count;
    this.spacer.style.height = `${count * ROW}px`;
    for (const row of this.rows.values()) this.release(row);
    this.rows.clear();
    this.mark(position, false);
    this.draw();
  }

  /** Marks the chosen position (-1: none) and brings it into sight. */
  mark(position, scroll = true) {
    this.position = position;
    if (scroll && position >= 0) {
      const top = position * ROW;
      const { scrollTop, clientHeight } = this.box;
      const away = top < scrollTop - clientHeight || top > scrollTop + 2 * clientHeight;
      if (away) this.box.scrollTop = top - clientHeight / 2;
      else if (top < scrollTop) this.box.scrollTop = top;
      else if (top + ROW > scrollTop + clientHeight) this.box.scrollTop = top + ROW - clientHeight;
    }
    this.draw();
    if (position >= 0 && this.rows.has(position)) this.box.setAttribute('aria-activedescendant', `row-${position}`);
    else this.box.removeAttribute('aria-activedescendant');
    for (const [at, row] of this.rows) row.setAttribute('aria-selected', String(at === position));
  }

  release(row) {
    row.hidden = true;
    row.removeAttribute('id');
    this.free.push(row);
  }

  draw() {
    const first = Math.max(0, Math.floor(this.box.scrollTop / ROW) - 4);
    const last = Math.min(this.count, Math.ceil((this.box.scrollTop + this.box.clientHeight) / ROW) + 4);
    for (const [at, row] of this.rows) {
      if (at < first || at >= last) {
        this.release(row);
        this.rows.delete(at);
      }
    }
    for (let at = first; at < last; at++) {
      if (this.rows.has(at)) continue;
      const row = this.free.pop() ?? this.create();
      row.hidden = false;
      row.id = `row-${at}`;
      row.dataset.position = at;
      row.style.transform = `translateY(${at * ROW}px)`;
      row.setAttribute('aria-posinset', at + 1);
      row.setAttribute('aria-setsize', this.count);
      row.setAttribute('aria-selected', String(at === this.position));
      this.fill(row, at);
      this.rows.set(at, row);
    }
  }

  create() {
    const row = document.createElement('div');
    row.className = 'row';
    row.setAttribute('role', 'option');
    this.spacer.append(row);
    return row;
  }

  key(event) {
    if (this.count === 0 || event.altKey || event.ctrlKey || event.metaKey) return;
    const page = Math.max(1, Math.floor(this.box.clientHeight / ROW) - 1);
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    const from = this.position < 0 ? (step > 0 ? -1 : this.count) : this.position;
    this.choose(Math.min(Math.max(from + step, 0), this.count - 1));
  }
}
