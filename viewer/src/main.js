// Starts the page: data, list, view, detail, and what connects them.

import { LoadBall } from './ball.js';
import { css, friction, frictionScale } from './colour.js';
import { drawCompare } from './compare.js';
import { load } from './data.js';
import { Detail, statusOf, verdict } from './detail.js';
import { APPROACHES, EMPTY, pairName, pairs, select, sortKeys } from './filter.js';
import { count, fixed, number } from './format.js';
import { Histogram } from './histogram.js';
import { VirtualList } from './list.js';
import { drawLegend } from './legend.js';
import { drawRun, limits } from './run.js';
import { View } from './scene.js';
import { Take } from './take.js';
import { theme } from './theme.js';
import { triad } from './triad.js';
import { whatIf } from './whatif.js';
import { drawWhy, missWords, reason, tellingMiss } from './why.js';

const $ = (selector) => document.querySelector(selector);

/** The grip that the page's address names: `{ text, found, place }`, with no text where it names none. */
function address(report) {
  const text = /^#grip=(.*)$/.exec(location.hash)?.[1];
  const place = text ? report.indexOfId.get(Number(text)) : undefined;
  return { text, found: place !== undefined, place };
}

async function start() {
  const report = await load(document);
  const { header } = report;
  const file = header.part.file.split(/[\\/]/).pop();
  document.title = `${file}: ${count(header.grips.total)} grips`;
  $('#title').textContent = file;
  $('#title').title = header.part.file;
  const { holding, ranked } = header.summary;
  const grips = holding === undefined ? `${count(header.grips.total)} grips` : `${count(holding)} of ${count(ranked)} grips hold`;
  $('#subtitle').textContent = [header.gripper?.name, grips, `${count(header.loads.length)} load${header.loads.length === 1 ? '' : 's'}`].filter(Boolean).join(' \u00b7 ');
  const scale = frictionScale(Array.from(report.column.mu));
  let view = null;
  try {
    view = new View($('#view'), report, scale);
  } catch (error) {
    $('#no-webgl').hidden = false;
    $('#toolbar').hidden = $('#triad').toggleAttribute('hidden', true);
    console.warn('three-dimensional view not available:', error.message);
  }
  const ball = new LoadBall($('.ball'), report, view);
  const detail = new Detail($('#panel-grip'), report, ball);
  const turn = triad($('#triad'));
  view?.listeners.push(() => {
    turn(view.axes());
    ball.draw();
  });
  theme($('#theme'), (dark) => {
    view?.setTheme(dark);
    if (view) drawLegend($('#key ul'), report, scale, view.colours);
    ball.draw();
  });

  const asked = address(report);
  const state = { filter: { ...EMPTY }, key: 'rank', direction: 1, order: [], chosen: -1, pinned: -1, marked: new Set() };
  const keys = sortKeys(report);
  const squeeze = report.column.force_needed.some(Number.isFinite);
  if (!squeeze) delete keys.squeeze;
  const third = squeeze ? 'squeeze' : 'alpha';
  $('#columns').querySelector('[data-key="squeeze"]').dataset.key = third;
  if (!squeeze) $('#columns').querySelector('[data-key="alpha"]').innerHTML = 'Tilt<i>\u00b0</i>';

  // As many decimals as the middle grip needs for three digits.
  const middle = Float32Array.from(report.column.mu).filter((mu) => mu > 0).sort();
  const decimals = middle.length ? Math.min(Math.max(2 - Math.floor(Math.log10(middle[middle.length >> 1])), 3), 6) : 3;
  const list = new VirtualList($('#list'), {
    fill(row, position) {
      const i = state.order[position];
      const c = report.column;
      const mu = report.mu(i);
      const [status, kind] = verdict(report, i);
      row.replaceChildren();
      const cell = (className, text) => {
        const span = document.createElement('span');
        span.className = className;
        span.textContent = text;
        row.append(span);
        return span;
      };
      cell('rank', `${state.marked.has(i) ? '\u2605 ' : ''}${count(c.rank[i])}`);
      const needed = cell('mu', Number.isFinite(mu) ? fixed(mu, decimals) : '\u2013');
      needed.style.setProperty('--swatch', Number.isFinite(mu) ? css(friction(scale.at(mu))) : 'transparent');
      const value = squeeze ? report.squeeze(i) : (c.alpha[i] * 180) / Math.PI;
      cell('number', fixed(value, value < 99.95 ? 1 : 0));
      cell('number', fixed(c.width[i] * 1e3, 1));
      cell('faces', pairName(report, i));
      cell(`dot ${kind}`, '').title = status;
      row.setAttribute('aria-label', `Rank ${c.rank[i]}, friction needed ${number(mu)}, ${squeeze ? `squeeze ${number(value)} newtons` : `tilt ${number(value)} degrees`}, width ${number(c.width[i] * 1e3)} millimetres, faces ${c.face_i[i]} and ${c.face_ii[i]}, ${status}${state.marked.has(i) ? ', marked' : ''}`);
    },
    choose: (position) => choose(state.order[position]),
  });

  function choose(i, { glide = true, scroll = true } = {}) {
    state.chosen = i;
    list.mark(state.order.indexOf(i), scroll);
    if (view?.misses.shown >= 0) $('#note').textContent = note;
    view?.setGrip(i, glide);
    detail.show(i);
    showPinned();
    showMark();
    const c = report.column;
    $('#said').textContent = `Grip ${c.rank[i]}: friction needed ${number(report.mu(i))}, ${verdict(report, i)[0]}`;
    history.replaceState(null, '', `#grip=${c.id[i]}`);
  }

  function showPinned() {
    drawCompare($('#compare'), report, state.pinned, state.chosen);
    view?.setPinned(state.pinned === state.chosen ? -1 : state.pinned);
    $('#pin').setAttribute('aria-pressed', String(state.pinned >= 0));
    $('#pin').textContent = state.pinned >= 0 ? `Let go of grip ${count(report.column.rank[state.pinned])}` : 'Pin to compare';
  }
  $('#pin').addEventListener('click', () => {
    state.pinned = state.pinned >= 0 ? -1 : state.chosen;
    showPinned();
  });
  const take = new Take($('#take'), report, view, state);
  take.onPrinted = () => detail.pick(detail.load);
  function showMark() {
    $('#mark').setAttribute('aria-pressed', String(state.marked.has(state.chosen)));
    $('#mark').textContent = state.marked.has(state.chosen) ? 'Marked' : 'Mark';
    take.show();
  }
  function mark() {
    if (state.chosen < 0) return;
    if (!state.marked.delete(state.chosen)) state.marked.add(state.chosen);
    $('#said').textContent = `Grip ${report.column.rank[state.chosen]} ${state.marked.has(state.chosen) ? 'marked' : 'no longer marked'}`;
    showMark();
    list.reset(state.order.length, state.order.indexOf(state.chosen));
  }
  $('#mark').addEventListener('click', mark);
  detail.onLoad = (load, state) => view?.setLoad(load, state);

  const histogram = new Histogram($('#histogram'), report, scale, (low, high) => {
    Object.assign(state.filter, { low, high });
    relist();
  });

  function relist() {
    state.order = select(report, state.filter, state.key, state.direction);
    list.reset(state.order.length, state.order.indexOf(state.chosen));
    $('#list').scrollTop = 0;
    list.draw();
    const all = state.order.length === report.n;
    const slips = report.friction ? state.order.reduce((sum, i) => sum + (verdict(report, i)[1] === 'bad' ? 1 : 0), 0) : 0;
    const hold = (report.changed || slips > 0) && report.friction ? `, ${report.estimate ? '\u2248\u2009' : ''}${count(state.order.length - slips)} hold` : '';
    $('#count').textContent = (all ? `${count(report.n)} grips` : `${count(state.order.length)} of ${count(report.n)} grips`) + hold;
    $('#empty').hidden = state.order.length > 0;
    $('#list').hidden = state.order.length === 0;
    const filtered = JSON.stringify(state.filter) !== JSON.stringify(EMPTY) || state.filter.low !== -Infinity || state.filter.high !== Infinity;
    $('#clear').disabled = !filtered;
    if (state.chosen >= 0) take.show();
    histogram.draw(all ? null : state.order);
    view?.setListed(state.order);
    for (const button of document.querySelectorAll('#columns button')) {
      const active = button.dataset.key === state.key;
      button.setAttribute('aria-pressed', String(active));
      button.dataset.direction = active ? (state.direction > 0 ? 'up' : 'down') : '';
    }
    $('#sort').value = state.key;
    const up = state.direction > 0;
    $('#direction').textContent = up ? '\u2191' : '\u2193';
    $('#direction').setAttribute('aria-label', up ? 'Smallest first' : 'Largest first');
  }

  function sortBy(key) {
    state.direction = key === state.key ? -state.direction : keys[key].best;
    state.key = key;
    relist();
  }

  const option = (value, text) => new Option(text, value);
  $('#sort').append(...Object.entries(keys).map(([key, { name }]) => option(key, name)));
  $('#pair').append(option('', 'All face pairs'), ...pairs(report).map(([pair, n]) => option(pair, `${pair.replace('/', ' / ')}  (${count(n)})`)));
  $('#status').append(option('', 'Any status'), ...header.statuses.map((name) => option(name, statusOf(name)[0])));
  if (report.friction) $('#status').append(option('kind:good', 'All but slipping'), option('kind:bad', 'Slipping'));
  $('#approach').append(option('', 'Any approach'), ...APPROACHES.map(([value, name]) => option(value, name)));
  $('#columns').addEventListener('click', (event) => {
    const { key } = event.target.closest('button')?.dataset ?? {};
    if (key) sortBy(key);
  });
  $('#sort').addEventListener('change', (event) => {
    state.key = '';
    sortBy(event.target.value);
  });
  $('#direction').addEventListener('click', () => sortBy(state.key));
  $('#turns').hidden = !report.column.turn_of;
  const fields = Object.keys(EMPTY).filter((name) => name !== 'low' && name !== 'high');
  for (const id of fields) {
    $(`#${id}`).addEventListener('input', (event) => {
      state.filter[id] = event.target.value;
      relist();
    });
  }
  const clear = () => {
    state.filter = { ...EMPTY };
    for (const id of fields) $(`#${id}`).value = '';
    histogram.reset();
    relist();
  };
  $('#clear').addEventListener('click', clear);
  $('#empty button').addEventListener('click', clear);

  whatIf($('#what-if'), report, () => {
    const load = detail.load;
    histogram.setPlanned(report.estimate);
    relist();
    view?.recolour();
    if (state.chosen >= 0) {
      detail.show(state.chosen);
      detail.pick(load);
      showPinned();
    }
    list.mark(state.order.indexOf(state.chosen));
  });
  drawRun($('#run-content'), report);
  const why = drawWhy($('#panel-why'), report, view && showMiss);
  $('#tab-why').hidden = !why;
  document.body.classList.toggle('no-grips', report.n === 0);
  const note = report.n === 0 && header.gripper ? `${header.gripper.name} beside the part, to scale, its jaws at their widest.` : (limits(report)[0] ?? '');
  $('#note').textContent = note;
  bindView();
  bindTabs();

  /** Shows rejected candidate `k` in the view (-1: the chosen grip again). */
  function showMiss(k) {
    view.setMiss(k);
    if (k < 0 && state.chosen >= 0) detail.pick(detail.load);
    else view.fit(state.chosen, report.miss(k).reason.startsWith('face_pair'));
    for (const item of document.querySelectorAll('[data-miss]')) item.querySelector('button').setAttribute('aria-pressed', String(Number(item.dataset.miss) === k));
    $('#note').textContent = k < 0 ? note : `Rejected, ${reason(report.miss(k).reason, report).title.toLowerCase()}: ${missWords(report, k)}.`;
    $('#said').textContent = $('#note').textContent;
  }

  function bindView() {
    if (!view) return;
    view.onPick = (i) => choose(i);
    view.onMiss = showMiss;
    const dots = $('[data-toggle="misses"]');
    dots.hidden = view.misses.of.length === 0;
    if (report.n === 0 && !dots.hidden) {
      dots.setAttribute('aria-pressed', 'true');
      view.show('misses', true);
    }
    $('#toolbar').addEventListener('click', (event) => {
      const button = event.target.closest('button');
      if (!button) return;
      const { act, toggle } = button.dataset;
      if (act === 'fit') view.fit();
      if (act === 'all') view.fit(state.chosen, true);
      if (act === 'grip') view.lookAtGrip();
      if (act === 'play') view.play();
      if (toggle) {
        const on = button.getAttribute('aria-pressed') !== 'true';
        button.setAttribute('aria-pressed', String(on));
        if (toggle === 'open') view.setOpen(on);
        else view.show(toggle, on);
      }
    });
    $('#unpick').addEventListener('click', () => detail.pick(-1));
    $('#turn').addEventListener('click', () => {
      const force = header.loads[detail.load >= 0 ? detail.load : report.column.load[state.chosen]].wrench.force;
      if (Math.hypot(...force) > 0) view.faceDirection(force);
    });
  }

  function bindTabs() {
    const tabs = [...document.querySelectorAll('[role="tab"]')];
    const open = (tab, focus) => {
      document.body.dataset.tab = tab.dataset.tab;
      tabs.forEach((other) => {
        other.setAttribute('aria-selected', String(other === tab));
        other.tabIndex = other === tab ? 0 : -1;
      });
      if (focus) tab.focus();
      list.draw();
      ball.draw();
    };
    const shown = () => tabs.filter((tab) => tab.offsetParent !== null);
    tabs.forEach((tab) => tab.addEventListener('click', () => open(tab)));
    $('[role="tablist"]').addEventListener('keydown', (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      const visible = shown();
      open(visible[(visible.indexOf(document.activeElement) + step + visible.length) % visible.length], true);
    });
    // The list has its own column on wide screens and a tab on narrow ones.
    const wide = window.matchMedia('(min-width: 1000px)');
    const settle = () => {
      $('#filter-box').open = wide.matches;
      const first = why && !asked.found ? 'why' : wide.matches ? 'grip' : 'list';
      open(tabs.find((tab) => tab.dataset.tab === first));
    };
    wide.addEventListener('change', settle);
    settle();
  }

  /** Says that the address names a grip that is not here. */
  function missing({ text, found }) {
    const box = $('#missing');
    box.hidden = text === undefined || found;
    if (box.hidden) return;
    const listed = header.grips.shown < header.grips.total ? ` It lists the best ${count(header.grips.shown)} of ${count(header.grips.total)}.` : '';
    const instead = report.n > 0 ? ` Grip ${count(report.column.rank[state.chosen])} is shown instead.` : ' It has no grips.';
    box.firstElementChild.textContent = `The link names grip \u201c${decodeURIComponent(text).slice(0, 40)}\u201d, which is not on this page.${listed}${instead}`;
  }
  $('#missing button').addEventListener('click', () => ($('#missing').hidden = true));

  document.addEventListener('keydown', (event) => {
    if ((event.key === 'm' || event.key === 'M') && !event.target.matches('input, select') && !event.ctrlKey && !event.metaKey && !event.altKey) mark();
    if (event.key === '/' && !event.target.matches('input, select')) {
      event.preventDefault();
      $('#text').focus();
    }
  });

  relist();
  if (report.n > 0) choose(asked.found ? asked.place : state.order[0], { glide: false });
  else if (view) {
    view.setGrip(-1);
    if (tellingMiss(report) >= 0) showMiss(tellingMiss(report));
  }
  missing(asked);
  if (!(view?.misses.shown >= 0)) view?.fit();
  view?.draw();
  // A link opened in the same tab, or the address edited by hand.
  window.addEventListener('hashchange', () => {
    const next = address(report);
    if (next.found) choose(next.place);
    missing(next);
  });
  document.documentElement.dataset.ready = String(Math.round(performance.now()));
  // For tests and for the curious: what is shown, as numbers.
  window.gripfast = {
    report, state, view, ball, detail, take,
    jaw: (side) => (view ? [...view.jaws.fingers[side].matrixWorld.elements] : null),
  };
}

start().catch((error) => {
  document.documentElement.dataset.ready = 'failed';
  const box = $('#failed');
  box.hidden = false;
  box.textContent = `This page could not be shown: ${error.message}`;
  console.error(error);
});
