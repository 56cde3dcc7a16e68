// @ts-check
// Draws traces, events and axes on a canvas.

import {draw, starts} from './columns.js';
import {END, Events, TRIGGER} from './events.js';
import {colour, fit} from './palette.js';
import {FILLER, HEALING} from './store.js';

/** @typedef {import('./store.js').Store} Store */
/** @typedef {import('./traces.js').Traces} Traces */

/** Room for labels at the left, for events at the top and for the time axis at the bottom, CSS pixels. */
const LEFT = 46, TOP = 15, BOTTOM = 18;
/** Time between two drawings of the whole plot, milliseconds; in between only new columns are drawn. */
const REDRAW_MS = 1000;
/** Drawings whose times are kept. */
const DRAWINGS = 1024;
const FONT = '"DejaVu Sans", sans-serif';

export class Plot {
  /** @param {HTMLCanvasElement} canvas @param {Traces} traces */
  constructor(canvas, traces) {
    this.canvas = canvas;
    this.traces = traces;
    this.context = fit(canvas);
    /** Column after the last one drawn; columns count from device time 0. */
    this.drawn = -1;
    this.lastWhole = -Infinity;
    /** The cursor's sample in the newest drawing. */
    this.lastCursor = -1;
    /** Values at the middle of the rows, of the first stream and of the second one.
     * @type {Float64Array[]} */
    this.centres = [];
    /** Times of the newest drawings, milliseconds, and the number of all. */
    this.took = new Float32Array(DRAWINGS);
    this.count = 0;
    new ResizeObserver(() => this.invalidate()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.invalidate());
  }

  invalidate() { this.lastWhole = -Infinity; }

  /** Number of drawings, and median, 99th percentile and longest time of the newest ones, milliseconds. */
  cost() {
    const took = this.took.slice(0, Math.min(this.count, DRAWINGS)).sort();
    const [median, late, longest] = [0.5, 0.99, 1].map((part) => took[Math.floor(part * (took.length - 1))] ?? 0);
    return {count: this.count, median, late, longest};
  }

  /** Geometry in pixels of the screen; `column` is in microseconds. */
  geometry() {
    const ratio = devicePixelRatio, {width: all, height: whole} = this.canvas;
    const left = Math.round(LEFT * ratio), top = Math.round(TOP * ratio), width = Math.max(1, all - left);
    const height = Math.max(1, whole - top - Math.round(BOTTOM * ratio));
    const column = this.traces.seconds * 1e6 / width, pitch = height / Math.max(1, this.traces.rows.length);
    return {ratio, left, top, width, height, column, pitch};
  }

  /** Device time and row at a point.
   * @param {number} x @param {number} y CSS pixels */
  place(x, y) {
    const {ratio, left, top, width, column, pitch} = this.geometry();
    const row = Math.floor((y * ratio - top) / pitch);
    const time = (this.end(column) - (left + width - x * ratio)) * column;
    return {time, row: Math.min(this.traces.rows.length - 1, Math.max(0, row))};
  }

  /** Column after the last one that is shown.
   * @param {number} column microseconds */
  end(column) { return Math.floor(this.traces.edge() / column) + 1; }

  /** Draws what has changed; called for each frame of the screen.
   * @param {number} now milliseconds */
  draw(now) {
    const {traces, canvas, context} = this, store = traces.store;
    if (canvas.clientWidth === 0 || canvas.clientHeight === 0) return;
    const begun = performance.now();
    const due = now - this.lastWhole >= (traces.held === null ? REDRAW_MS : Infinity);
    if (due) fit(canvas);
    const {left, top, width, height, column} = this.geometry();
    const end = this.end(column), moved = end - this.drawn;
    const whole = due || moved < 0 || moved >= width;
    if (!whole && moved === 0 && this.lastCursor === traces.cursor.index) return;
    if (whole || !store) {
      this.lastWhole = now;
      context.fillStyle = colour('ground').css;
      context.fillRect(0, 0, canvas.width, canvas.height);
      this.centres = traces.references.map(({store: one}) => this.centre(one));
      this.labels();
      this.columns(end - width, end, end);
    } else if (moved > 0) {
      context.drawImage(canvas, left + moved, top, width - moved, height, left, top, width - moved, height);
      // The newest column was not complete, and a line can lead through the one before it.
      this.columns(this.drawn - 2, end, end);
    }
    this.drawn = end;
    this.lastCursor = traces.cursor.index;
    this.axis(end);
    this.descriptions(end);
    this.cursor(end);
    this.took[this.count % DRAWINGS] = performance.now() - begun;
    this.count += 1;
  }

  /** Returns the mean of the newest second of each channel.
   * @param {Store} store */
  centre(store) {
    const {held} = this.traces, sums = new Float64Array(store.channels);
    const to = held === null ? store.next : store.at(held + 1), from = Math.max(store.first, to - store.rate);
    for (let i = from; i < to; i += 1) {
      const {values} = store.chunk(i), row = store.row(i);
      for (let channel = 0; channel < sums.length; channel += 1) sums[channel] += values[row + channel];
    }
    const means = sums.map((sum) => (to > from ? sum / (to - from) : 0));
    const reference = this.traces.references.find((one) => one.store === store);
    if (!reference?.average || reference.part.length === 0) return means;
    const mean = reference.part.reduce((sum, channel) => sum + means[channel], 0) / reference.part.length;
    return means.map((one, channel) => (channel < store.electrodes ? one - mean : one));
  }

  labels() {
    const {ratio, left, top, pitch} = this.geometry(), {store, rows, substituted, cursor} = this.traces;
    if (!store) return;
    const {context} = this, size = Math.min(12 * ratio, Math.max(7.5 * ratio, pitch * 0.95));
    context.font = `${size}px ${FONT}`;
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    rows.forEach((channel, row) => {
      const label = store.labels[channel], filled = substituted.has(label);
      context.fillStyle = colour(filled ? 'substituted' : channel === cursor.channel ? 'chosen' : 'faint').css;
      context.fillText(filled ? `${label}*` : label, left - 4 * ratio, top + pitch * (row + 0.5));
    });
  }

  /** Draws the columns from `first` to before `last`; those left of the plot are left out.
   * @param {number} first @param {number} last @param {number} end the column after the right edge */
  columns(first, last, end) {
    const {left, top, width, height, column, pitch, ratio} = this.geometry();
    const from = Math.max(first, end - width), count = last - from;
    if (count <= 0) return;
    const image = this.context.createImageData(count, height);
    new Uint32Array(image.data.buffer).fill(colour('ground').word);
    const {references, rows, cursor, substituted, store, microvolts} = this.traces;
    const begins = references.map((reference) => starts(reference.store, from, count, column));
    references.forEach((reference, k) => this.shade(image, reference.store, begins[k], from));
    this.lines(image, from, last);
    references.forEach((reference, k) => {
      const places = rows.flatMap((channel, row) => {
        const label = /** @type {Store} */ (store).labels[channel];
        const own = k === 0 ? channel : reference.store.labels.indexOf(label);
        const plain = substituted.has(label) ? 'substituted' : 'trace';
        const name = k > 0 ? 'over' : channel === cursor.channel ? 'chosen' : plain;
        const middle = pitch * (row + 0.5), centre = this.centres[k][own];
        return own < 0 ? [] : [{channel: own, middle, centre, scale: pitch / microvolts, colour: colour(name)}];
      });
      draw(image, reference, places, begins[k], from, column, Math.max(1, Math.round(ratio)));
    });
    this.context.putImageData(image, left + width - end + from, top);
  }

  /** Shades fillers and healing samples.
   * @param {ImageData} image @param {Store} store
   * @param {Float64Array} begins @param {number} first column */
  shade(image, store, begins, first) {
    const {column} = this.geometry(), interval = Math.ceil(Math.max(1, 1e6 / store.rate / column));
    const from = Math.max(store.first, begins[0] - interval - 1), to = begins[begins.length - 1];
    for (let i = from; i < to; i += 1) {
      const flags = store.flag(i);
      if (!(flags & (FILLER | HEALING))) continue;
      const name = flags & FILLER ? 'filler' : 'healing';
      this.bar(image, Math.floor(store.time(i) / column) - first, interval, name);
    }
  }

  /** Draws a line at the sample of each event.
   * @param {ImageData} image @param {number} first @param {number} last */
  lines(image, first, last) {
    const {ratio} = this.geometry();
    const width = Math.max(1, Math.round(ratio));
    for (const {at, name} of this.events(first, last)) this.bar(image, at - first, width, name);
  }

  /** Events with their columns in `first..last`.
   * @param {number} first @param {number} last */
  events(first, last) {
    const {stream, events} = this.traces, {column} = this.geometry();
    if (!stream || !events) return [];
    const sample = 1e6 / stream.store.rate;
    return events.between(first * column - 2 * sample, last * column + 2 * sample).flatMap((event) => {
      const index = Events.sample(event, stream.store, stream.measured);
      const name = (event.code & ~END) === TRIGGER ? 'trigger' : 'event';
      const at = index < 0 ? -1 : Math.floor(stream.store.time(index) / column);
      return at < first || at >= last ? [] : [{at, name, text: event.description}];
    });
  }

  /** @param {ImageData} image @param {number} x @param {number} width @param {string} name of the colour */
  bar(image, x, width, name) {
    const pixels = new Uint32Array(image.data.buffer), {word} = colour(name);
    const from = Math.max(0, x), to = Math.min(image.width, x + width);
    for (let start = 0; from < to && start < pixels.length; start += image.width) {
      pixels.fill(word, start + from, start + to);
    }
  }

  /** Draws the axis of device time.
   * @param {number} end */
  axis(end) {
    const {ratio, left, top, width, height, column} = this.geometry(), {context, canvas} = this;
    const {seconds} = this.traces, base = top + height;
    context.fillStyle = colour('ground').css;
    context.fillRect(0, base, canvas.width, canvas.height - base);
    context.fillStyle = colour('line').css;
    context.fillRect(left, base, width, 1);
    context.fillStyle = colour('faint').css;
    context.font = `${11 * ratio}px ${FONT}`;
    context.textAlign = 'center';
    context.textBaseline = 'bottom';
    const tick = [0.1, 0.2, 0.5, 1, 2, 5].find((one) => seconds / one <= width / ratio / 64) ?? 10;
    const right = end * column / 1e6;
    for (let n = Math.max(0, Math.ceil((right - seconds) / tick)); n * tick < right; n += 1) {
      const x = left + width - end + Math.floor(n * tick * 1e6 / column);
      context.fillRect(x, base, 1, 4 * ratio);
      const text = `${(n * tick).toFixed(tick < 1 ? 1 : 0)} s`;
      if (x > left + 16 * ratio && x < left + width - 16 * ratio) context.fillText(text, x, canvas.height);
    }
  }

  /** Writes the descriptions of events above their lines, each up to the next one.
   * @param {number} end */
  descriptions(end) {
    const {ratio, left, top, width} = this.geometry(), {context, canvas} = this;
    context.fillStyle = colour('ground').css;
    context.fillRect(0, 0, canvas.width, top);
    context.font = `${10 * ratio}px ${FONT}`;
    context.textAlign = 'left';
    context.textBaseline = 'middle';
    const shown = this.events(end - width, end);
    shown.forEach(({at, name, text}, k) => {
      const x = left + width - end + at;
      const next = k + 1 < shown.length ? left + width - end + shown[k + 1].at : canvas.width;
      context.save();
      context.beginPath();
      context.rect(x, 0, Math.max(0, next - x - 2 * ratio), top);
      context.clip();
      context.fillStyle = colour(name).css;
      context.fillRect(x, top / 2, Math.max(1, Math.round(ratio)), top / 2);
      context.fillText(this.shorten(text, next - x - 6 * ratio), x + 4 * ratio, top / 2);
      context.restore();
    });
  }

  /** Returns as much of a text as fits.
   * @param {string} text @param {number} width */
  shorten(text, width) {
    if (this.context.measureText(text).width <= width) return text;
    let end = text.length - 1;
    while (end > 0 && this.context.measureText(`${text.slice(0, end)}\u2026`).width > width) end -= 1;
    return end > 0 ? `${text.slice(0, end)}\u2026` : '';
  }

  /** Marks the cursor's sample on the time axis.
   * @param {number} end */
  cursor(end) {
    const {store, cursor: {index}} = this.traces;
    if (!store || index < store.first) return;
    const {left, top, width, height, column, ratio} = this.geometry();
    const x = left + width - end + Math.floor(store.time(index) / column);
    if (x < left || x >= left + width) return;
    this.context.fillStyle = colour('chosen').css;
    this.context.fillRect(x - ratio, top + height, Math.max(1, Math.round(ratio)) + 2 * ratio, 7 * ratio);
  }
}
