// @ts-check
// Draws the traces of a store, and moves a cursor over its samples.

import {FILLER, HEALING} from './store.js';

/** @typedef {import('./store.js').Store} Store */

/** Room for labels at the left and for the time axis at the bottom, CSS pixels. */
const LEFT = 46, BOTTOM = 18;
/** Time between two drawings of the whole plot, milliseconds; in between only new columns are drawn. */
const REDRAW_MS = 1000;
/** From this many samples per column on, a column shows their least and greatest value. */
const DENSE = 2;
/** What is said of an excluded electrode in decoded signals, and in measured ones. */
const EXCLUDED = ['electrode filled from the others', 'electrode excluded from the codes'];

export class Traces {
  /** @param {HTMLCanvasElement} canvas @param {(text: string) => void} onCursor */
  constructor(canvas, onCursor) {
    this.canvas = canvas;
    this.onCursor = onCursor;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d', {alpha: false}));
    /** @type {Store | null} */
    this.store = null;
    this.microvolts = 100;
    this.seconds = 10;
    /** @type {Set<string>} labels of electrodes that the device excludes from its codes */
    this.substituted = new Set();
    /** Whether excluded electrodes have the values that were measured, not those filled in. */
    this.measured = false;
    /** @type {number[]} channels of the rows, from the top */
    this.rows = [];
    /** @type {number | null} device time at the right edge while paused */
    this.held = null;
    /** Index of the sample and channel at the cursor; no sample before the first move. */
    this.cursor = {index: -1, channel: 0};
    /** Column after the last one drawn; columns count from device time 0. */
    this.drawn = -1;
    this.lastWhole = -Infinity;
    /** Longest time of a drawing so far, and number and sum of all, milliseconds. */
    this.cost = {longest: 0, count: 0, sum: 0};
    canvas.addEventListener('mousemove', (event) => this.point(event.offsetX, event.offsetY));
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.invalidate());
  }

  invalidate() { this.lastWhole = -Infinity; }

  resize() {
    const ratio = devicePixelRatio;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this.invalidate();
  }

  /** @param {Store | null} store @param {string[]} labels shown electrodes; all if there is none */
  show(store, labels) {
    const wanted = new Set(labels.map((label) => label.toLowerCase()));
    this.rows = [];
    if (store) {
      const all = store.labels.map((_, channel) => channel);
      const named = all.filter((channel) => wanted.has(store.labels[channel].toLowerCase()));
      this.rows = named.length > 0 ? named : all;
    }
    if (store !== this.store) {
      this.store = store;
      this.held = null;
      this.cursor.index = -1;
    }
    if (!this.rows.includes(this.cursor.channel)) this.cursor.channel = this.rows[0] ?? 0;
    this.invalidate();
  }

  /** @param {boolean} paused */
  pause(paused) {
    this.held = paused && this.store ? this.store.end() : null;
    this.invalidate();
  }

  /** @param {number} seconds scrolls the paused plot, within the store */
  scroll(seconds) {
    if (!this.store || this.store.next === this.store.first) return;
    const end = (this.held ?? this.store.end()) + seconds * 1e6;
    this.held = Math.min(Math.max(end, this.store.time(this.store.first)), this.store.end());
    this.invalidate();
  }

  /** Geometry of the plot in pixels of the screen. */
  geometry() {
    const ratio = devicePixelRatio;
    const left = Math.round(LEFT * ratio), width = Math.max(1, this.canvas.width - left);
    const height = Math.max(1, this.canvas.height - Math.round(BOTTOM * ratio));
    return {ratio, left, width, height, column: this.seconds * 1e6 / width, pitch: height / Math.max(1, this.rows.length)};
  }

  /** Column after the last one that is shown. @param {number} column microseconds per column */
  end(column) {
    const time = this.held ?? (this.store ? this.store.end() : 0);
    return Math.floor(time / column) + 1;
  }

  /** Draws what has changed; called for each frame of the screen. @param {number} now milliseconds */
  draw(now) {
    const store = this.store;
    if (this.canvas.width === 0) return;
    const begun = performance.now();
    const {left, width, height, column} = this.geometry();
    const end = this.end(column);
    const moved = end - this.drawn;
    const whole = now - this.lastWhole >= (this.held === null ? REDRAW_MS : Infinity) || moved < 0 || moved >= width;
    if (!whole && moved === 0) return;
    const style = getComputedStyle(document.documentElement);
    /** @param {string} name */
    const color = (name) => style.getPropertyValue(`--${name}`).trim();
    if (whole || !store) {
      this.lastWhole = now;
      this.centre();
      this.context.fillStyle = color('ground');
      this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
      this.labels(color);
      this.columns(end - width, end, end, color);
    } else {
      // The newest column was not complete, and a line can lead through the one before it.
      const first = this.drawn - 2;
      this.context.drawImage(this.canvas, left + moved, 0, width - moved, height, left, 0, width - moved, height);
      this.columns(first, end, end, color);
    }
    this.axis(end, color);
    this.drawn = end;
    this.drawCursor(end, color);
    const took = performance.now() - begun;
    this.cost.longest = Math.max(this.cost.longest, took);
    this.cost.count += 1;
    this.cost.sum += took;
  }

  /** Chooses the value at the middle of each row: the mean of the newest second. */
  centre() {
    const store = this.store;
    this.centres = new Float64Array(store ? store.channels : 0);
    if (!store) return;
    const to = this.held === null ? store.next : store.at(this.held + 1);
    const from = Math.max(store.first, to - store.rate);
    for (let channel = 0; channel < store.channels; channel += 1) {
      let sum = 0;
      for (let i = from; i < to; i += 1) sum += store.value(i, channel);
      this.centres[channel] = to > from ? sum / (to - from) : 0;
    }
  }

  /** @param {number} row @param {number} value @returns {number} pixel from the top */
  y(row, value) {
    const {pitch} = this.geometry();
    const centre = this.centres ? this.centres[this.rows[row]] : 0;
    return pitch * (row + 0.5 - (value - centre) / this.microvolts);
  }

  /** @param {(name: string) => string} color */
  labels(color) {
    const {ratio, left, pitch} = this.geometry();
    const store = this.store;
    if (!store) return;
    const size = Math.min(12 * ratio, Math.max(7.5 * ratio, pitch * 0.95));
    this.context.font = `${size}px "DejaVu Sans", sans-serif`;
    this.context.textAlign = 'right';
    this.context.textBaseline = 'middle';
    this.rows.forEach((channel, row) => {
      const label = store.labels[channel];
      const filled = this.substituted.has(label);
      this.context.fillStyle = color(filled ? 'substituted' : channel === this.cursor.channel ? 'chosen' : 'faint');
      this.context.fillText(filled ? `${label}*` : label, left - 4 * ratio, pitch * (row + 0.5));
    });
  }

  /**
   * Draws the columns from `first` to before `last`. `end` is the column after the right edge.
   * @param {number} first @param {number} last @param {number} end @param {(name: string) => string} color
   */
  columns(first, last, end, color) {
    const store = this.store, context = this.context;
    const {left, width, height, column, ratio} = this.geometry();
    const x0 = left + width - end;
    context.save();
    context.beginPath();
    context.rect(Math.max(left, x0 + first), 0, last - first, height);
    context.clip();
    context.fillStyle = color('ground');
    context.fillRect(x0 + first, 0, last - first, height);
    if (!store || store.next === store.first) {
      context.restore();
      return;
    }
    // Index of the first sample of each column, and after the last column.
    const starts = new Float64Array(last - first + 1);
    let from = store.at(first * column);
    for (let k = 0; k <= last - first; k += 1) {
      while (from < store.next && store.time(from) < (first + k) * column) from += 1;
      starts[k] = from;
    }
    this.shade(starts, first, x0, color);
    const perColumn = store.rate * column / 1e6;
    context.lineWidth = Math.max(1, Math.round(ratio));
    context.lineJoin = 'bevel';
    for (let row = this.rows.length - 1; row >= 0; row -= 1) {
      const channel = this.rows[row];
      const filled = this.substituted.has(store.labels[channel]);
      context.strokeStyle = color(channel === this.cursor.channel ? 'chosen' : filled ? 'substituted' : 'trace');
      context.beginPath();
      if (perColumn >= DENSE) this.envelope(starts, row, x0 + first);
      else this.line(starts[0], starts[last - first], row, x0);
      context.stroke();
    }
    context.restore();
  }

  /** Shades fillers and healing samples, and draws a line at each rising edge of the trigger.
   * @param {Float64Array} starts @param {number} first @param {number} x0 @param {(name: string) => string} color */
  shade(starts, first, x0, color) {
    const store = /** @type {Store} */ (this.store), context = this.context;
    const {height, column, ratio} = this.geometry();
    const interval = Math.max(1, 1e6 / store.rate / column);
    const begin = Math.max(store.first, starts[0] - Math.ceil(interval) - 1);
    for (let i = begin; i < starts[starts.length - 1]; i += 1) {
      const x = x0 + Math.floor(store.time(i) / column);
      const flags = store.flag(i);
      if (flags & (FILLER | HEALING)) {
        context.fillStyle = color(flags & FILLER ? 'filler' : 'healing');
        context.fillRect(x, 0, Math.ceil(interval), height);
      }
      // A decoded step has the trigger of its window's last step.
      if (this.measured && i > store.first && store.trigger(i) > store.trigger(i - 1)) {
        context.fillStyle = color('trigger');
        context.fillRect(x, 0, Math.max(1, Math.round(ratio)), height);
      }
    }
  }

  /** Adds to the path, for each column, the range of its samples and of the one before them.
   * @param {Float64Array} starts @param {number} row @param {number} x */
  envelope(starts, row, x) {
    const store = /** @type {Store} */ (this.store);
    const channel = this.rows[row];
    for (let k = 0; k + 1 < starts.length; k += 1) {
      const [from, to] = [starts[k], starts[k + 1]];
      if (to <= from) continue;
      let [least, greatest] = [Infinity, -Infinity];
      const joined = from > store.first && !this.gap(from) ? from - 1 : from;
      for (let i = joined; i < to; i += 1) {
        const value = store.value(i, channel);
        if (value < least) least = value;
        if (value > greatest) greatest = value;
      }
      const top = this.y(row, greatest), bottom = this.y(row, least);
      this.context.moveTo(x + k + 0.5, top);
      this.context.lineTo(x + k + 0.5, Math.max(bottom, top + 1));
    }
  }

  /** Adds a line through the samples to the path. @param {number} from @param {number} to @param {number} row @param {number} x0 */
  line(from, to, row, x0) {
    const store = /** @type {Store} */ (this.store);
    const {column} = this.geometry();
    const channel = this.rows[row];
    let pen = false;
    for (let i = Math.max(store.first, from - 1); i < Math.min(store.next, to + 1); i += 1) {
      const x = x0 + store.time(i) / column, y = this.y(row, store.value(i, channel));
      if (pen && !this.gap(i)) this.context.lineTo(x, y);
      else this.context.moveTo(x, y);
      pen = true;
    }
  }

  /** Whether samples are missing before this one. @param {number} index */
  gap(index) {
    const store = /** @type {Store} */ (this.store);
    return store.time(index) - store.time(index - 1) > 2.5e6 / store.rate;
  }

  /** Draws the axis of device time. @param {number} end @param {(name: string) => string} color */
  axis(end, color) {
    const {ratio, left, width, height, column} = this.geometry();
    const context = this.context;
    context.fillStyle = color('ground');
    context.fillRect(0, height, this.canvas.width, this.canvas.height - height);
    context.fillStyle = color('line');
    context.fillRect(left, height, width, 1);
    context.fillStyle = color('faint');
    context.font = `${11 * ratio}px "DejaVu Sans", sans-serif`;
    context.textAlign = 'center';
    context.textBaseline = 'bottom';
    const tick = [0.1, 0.2, 0.5, 1, 2, 5].find((one) => this.seconds / one <= 10) ?? 5;
    const right = end * column / 1e6;
    for (let n = Math.ceil((right - this.seconds) / tick); n * tick < right; n += 1) {
      const x = left + width - end + Math.floor(n * tick * 1e6 / column);
      context.fillRect(x, height, 1, 4 * ratio);
      const text = `${(n * tick).toFixed(tick < 1 ? 1 : 0)} s`;
      if (n >= 0 && x > left + 16 * ratio && x < left + width - 16 * ratio) context.fillText(text, x, this.canvas.height);
    }
  }

  /** Moves the cursor to a point of the canvas. @param {number} x @param {number} y CSS pixels */
  point(x, y) {
    const store = this.store;
    if (!store || store.next === store.first) return;
    const {ratio, left, width, column, pitch} = this.geometry();
    const time = (this.end(column) - (left + width - x * ratio)) * column;
    const row = Math.min(this.rows.length - 1, Math.max(0, Math.floor(y * ratio / pitch)));
    this.place(Math.min(store.next - 1, store.at(time)), this.rows[row]);
  }

  /** Moves the cursor. @param {number} samples @param {number} rows */
  move(samples, rows) {
    const store = this.store;
    if (!store || store.next === store.first) return;
    const row = this.rows.indexOf(this.cursor.channel) + rows;
    const channel = this.rows[Math.min(this.rows.length - 1, Math.max(0, row))];
    const shown = this.held === null ? store.next - 1 : store.at(this.held + 1) - 1;
    const index = this.cursor.index < store.first ? shown : this.cursor.index + samples;
    this.place(Math.min(store.next - 1, Math.max(store.first, index)), channel);
  }

  /** @param {number} index @param {number} channel */
  place(index, channel) {
    if (index === this.cursor.index && channel === this.cursor.channel) return;
    this.cursor = {index, channel};
    this.invalidate();
    this.onCursor(this.words());
  }

  /** Describes the sample at the cursor with the digits that its value has at three decimals. */
  words() {
    const store = this.store, {index, channel} = this.cursor;
    if (!store || index < store.first) return 'no sample at the cursor';
    const flags = store.flag(index);
    const notes = [
      flags & FILLER ? 'replaced, was lost' : '',
      flags & HEALING ? 'decoded without its neighbours' : '',
      this.substituted.has(store.labels[channel]) ? EXCLUDED[Number(this.measured)] : '',
    ].filter((note) => note);
    const time = (store.time(index) / 1e6).toFixed(6);
    const value = store.value(index, channel).toFixed(3);
    return [`${store.labels[channel]} ${value} ${store.unit} at ${time} s`, ...notes].join('; ');
  }

  /** @param {number} end @param {(name: string) => string} color */
  drawCursor(end, color) {
    const store = this.store, {index} = this.cursor;
    if (!store || index < store.first || this.lastWhole === -Infinity) return;
    const {left, width, height, column, ratio} = this.geometry();
    const x = left + width - end + Math.floor(store.time(index) / column);
    if (x < left) return;
    this.context.fillStyle = color('chosen');
    this.context.fillRect(x, height, Math.max(1, Math.round(ratio)) + 2, 6 * ratio);
  }
}
