// @ts-check
// Shows what is lost on the way, how regularly codes arrive, and the bridge's reports.

import {find} from './element.js';
import {colour, fit} from './palette.js';

/** @typedef {import('./feed.js').Status} Status */

/** Number of intervals in the histogram: 64 s at 16 codes per second. */
const INTERVALS = 1024;
/** Time between two codes from which the device has paused, microseconds. */
const PAUSE_US = 1e6;
/** Reports after which a status that they lack is left out: three seconds. */
const MOST_AGE = 3;
/** Words for the levels of a report. */
const LEVELS = ['ok', 'warning', 'error', 'stale'];

export class Link {
  constructor() {
    this.figures = find('figures');
    this.reports = find('reports');
    this.interval = find('interval');
    /** @type {HTMLCanvasElement} */
    this.canvas = find('intervals');
    /** @type {number[]} milliseconds */
    this.intervals = [];
    this.last = NaN;
    /** The newest status of each name, and how many reports came after it.
     * @type {Map<string, {status: Status, age: number}>} */
    this.statuses = new Map();
    /** Messages that the bridge has dropped for this page. */
    this.dropped = 0;
  }

  /** Messages are missing: the next code starts a new interval. */
  restart() { this.last = NaN; }

  /** Forgets the reports of a bridge that was lost. */
  clear() {
    this.restart();
    this.statuses.clear();
  }

  /** Notes a code.
   * @param {number} publishedUs */
  code(publishedUs) {
    if (publishedUs >= this.last && publishedUs - this.last < PAUSE_US) {
      this.intervals.push((publishedUs - this.last) / 1000);
      if (this.intervals.length > INTERVALS) this.intervals.shift();
    }
    this.last = publishedUs;
  }

  /** @param {Status[]} statuses @param {number} fillers shown in the present stream */
  report(statuses, fillers) {
    for (const [name, known] of this.statuses) {
      known.age += 1;
      // What is no longer reported is not shown as if it were.
      if (known.age > MOST_AGE) this.statuses.delete(name);
    }
    for (const status of statuses) this.statuses.set(status.name, {status, age: 0});
    /** @param {string} name @param {string} key */
    const value = (name, key) => this.statuses.get(name)?.status.values.get(key) ?? '-';
    /** @type {[string, string][]} */
    const figures = [
      ['codes received', value('loss', 'received')],
      ['codes lost', value('loss', 'lost')],
      ['fillers of codes', value('loss', 'fillers')],
      ['samples filled here', String(fillers)],
      ['frames lost on the link', value('link', 'frames lost')],
      ['damaged (CRC)', value('link', 'CRC errors')],
      ['clock drift, ppm', value('clock', 'drift ppm')],
      ['connections, resets', `${value('device', 'connections')}, ${value('device', 'resets')}`],
      ['dropped for this page', String(this.dropped)],
    ];
    this.figures.replaceChildren(...figures.flatMap(([name, text]) => {
      const [term, data] = [document.createElement('dt'), document.createElement('dd')];
      term.textContent = name;
      data.textContent = text;
      return [term, data];
    }));
    this.reports.replaceChildren(...[...this.statuses.values()].map(({status}) => {
      const [item, level, message] = ['li', 'span', 'span'].map((name) => document.createElement(name));
      level.textContent = `${status.name}: ${LEVELS[status.level] ?? status.level}`;
      level.className = `level${status.level}`;
      message.textContent = status.message;
      message.className = 'message';
      message.title = status.message;
      item.append(level, message);
      return item;
    }));
    this.draw();
  }

  /** Draws the histogram of intervals between the codes, as the bridge has published them. */
  draw() {
    const count = this.intervals.length;
    if (count < 2) return;
    const mean = this.intervals.reduce((sum, one) => sum + one, 0) / count;
    const squares = this.intervals.reduce((sum, one) => sum + (one - mean) ** 2, 0);
    const deviation = Math.sqrt(squares / (count - 1));
    this.interval.textContent = `interval ${mean.toFixed(3)} ms, standard deviation ${deviation.toFixed(3)} ms, ` +
      `${count} intervals`;
    if (this.canvas.clientWidth === 0) return;
    const {canvas} = this, ratio = devicePixelRatio, context = fit(canvas);
    context.fillStyle = colour('panel').css;
    context.fillRect(0, 0, canvas.width, canvas.height);
    // Twenty bins at each side of the mean; those further off are in the outermost ones.
    const bin = Math.min(mean / 20, Math.max(0.05, deviation / 4)), bins = new Uint32Array(41);
    for (const one of this.intervals) bins[Math.min(40, Math.max(0, Math.round((one - mean) / bin) + 20))] += 1;
    const most = Math.max(...bins), base = canvas.height - 14 * ratio, width = canvas.width / 41;
    context.fillStyle = colour('trace').css;
    bins.forEach((number, index) => {
      const height = base * number / most;
      if (number > 0) context.fillRect(index * width, base - Math.max(1, height), width - 1, Math.max(1, height));
    });
    context.fillStyle = colour('faint').css;
    context.font = `${10 * ratio}px "DejaVu Sans", sans-serif`;
    context.textBaseline = 'bottom';
    /** @type {[number, CanvasTextAlign, number][]} */
    const labels = [[0, 'left', -20], [canvas.width / 2, 'center', 0], [canvas.width, 'right', 20]];
    for (const [x, align, offset] of labels) {
      context.textAlign = align;
      context.fillText(`${Math.max(0, mean + offset * bin).toFixed(1)} ms`, x, canvas.height);
    }
  }
}
