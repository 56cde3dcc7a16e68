// @ts-check
// The traces of a store, with those of a second one over them, and the cursor on their samples.

import {Events} from './events.js';
import {Plot} from './plot.js';
import {Reference} from './reference.js';
import {FILLER, HEALING} from './store.js';

/** @typedef {import('./store.js').Store} Store */

/** Longest time by which the second stream can be behind the first one, microseconds. The right edge waits
 * for it. */
const BEHIND_US = 2e6;
/** What is said of an excluded electrode in decoded signals, and in measured ones. */
const EXCLUDED = ['electrode filled from the others', 'electrode excluded from the codes'];

/**
 * A stream on the plot. `measured` tells whether excluded electrodes have the values that were measured, not
 * those filled in, and whether the trigger is that of each sample.
 * @typedef {{store: Store, name: string, measured: boolean}} Stream
 */

export class Traces {
  /** @param {HTMLCanvasElement} canvas @param {(text: string) => void} onCursor @param {Events | null} events */
  constructor(canvas, onCursor, events = null) {
    this.onCursor = onCursor;
    this.events = events;
    /** @type {Stream | null} */
    this.stream = null;
    /** The stream over the first one.
     * @type {Stream | null} */
    this.second = null;
    this.microvolts = 100;
    this.seconds = 10;
    /** Whether the mean of the electrodes is subtracted. */
    this.average = false;
    /** @type {Set<string>} labels of electrodes that the device excludes from its codes */
    this.substituted = new Set();
    /** @type {number[]} channels of the rows, from the top */
    this.rows = [];
    /** @type {number | null} device time at the right edge while paused */
    this.held = null;
    /** Index of the sample and channel at the cursor; no sample before the first move. */
    this.cursor = {index: -1, channel: 0};
    /** @type {Reference[]} of the first stream, and of the second one */
    this.references = [];
    this.plot = new Plot(canvas, this);
    canvas.addEventListener('mousemove', (event) => this.point(event.offsetX, event.offsetY));
  }

  get store() { return this.stream?.store ?? null; }

  /** Draws everything anew, because settings have changed. */
  invalidate() {
    const streams = [this.stream, this.second].flatMap((stream) => stream ?? []);
    this.references = streams.map(({store}) => new Reference(store, this.average, this.substituted));
    this.plot.invalidate();
  }

  /**
   * @param {Stream | null} stream @param {Stream | null} second
   * @param {string[]} labels shown electrodes; all if there is none
   */
  show(stream, second, labels) {
    const wanted = new Set(labels.map((label) => label.toLowerCase())), store = stream?.store ?? null;
    this.rows = [];
    if (store) {
      const all = [...store.labels.keys()];
      const named = all.filter((channel) => wanted.has(store.labels[channel].toLowerCase()));
      this.rows = named.length > 0 ? named : all;
    }
    if (store !== this.store) {
      this.held = null;
      this.cursor.index = -1;
    }
    this.stream = stream;
    this.second = second;
    if (!this.rows.includes(this.cursor.channel)) this.cursor.channel = this.rows[0] ?? 0;
    this.invalidate();
  }

  /** Device time at the right edge. */
  edge() {
    if (this.held !== null) return this.held;
    const ends = [this.stream, this.second].map((stream) => stream?.store.end() ?? 0);
    return this.second && ends[1] < ends[0] && ends[1] > ends[0] - BEHIND_US ? ends[1] : ends[0];
  }

  /** @param {boolean} paused */
  pause(paused) {
    this.held = paused && this.store ? this.edge() : null;
    this.invalidate();
  }

  /** Pauses with the right edge at a device time within the store.
   * @param {number} time */
  hold(time) {
    const store = this.store;
    if (!store || store.next === store.first) return;
    this.held = Math.min(Math.max(time, store.begun()), store.end());
    this.invalidate();
  }

  /** @param {number} seconds scrolls, within the store */
  scroll(seconds) { this.hold(this.edge() + seconds * 1e6); }

  /** Moves the cursor to a point of the canvas.
   * @param {number} x @param {number} y CSS pixels */
  point(x, y) {
    const store = this.store;
    if (!store || store.next === store.first) return;
    const {time, row} = this.plot.place(x, y);
    this.place(Math.min(store.next - 1, store.at(time)), this.rows[row]);
  }

  /** Moves the cursor.
   * @param {number} samples @param {number} rows */
  move(samples, rows) {
    const store = this.store;
    if (!store || store.next === store.first) return;
    const row = this.rows.indexOf(this.cursor.channel) + rows;
    const channel = this.rows[Math.min(this.rows.length - 1, Math.max(0, row))];
    const shown = Math.max(store.first, store.at(this.edge() + 1) - 1);
    const index = this.cursor.index < store.first ? shown : this.cursor.index + samples;
    this.place(Math.min(store.next - 1, Math.max(store.first, index)), channel);
  }

  /** @param {number} index @param {number} channel */
  place(index, channel) {
    if (index === this.cursor.index && channel === this.cursor.channel) return;
    const moved = channel !== this.cursor.channel;
    this.cursor = {index, channel};
    // The cursor's mark is drawn each time; the electrode's colour is a part of the traces.
    if (moved) this.plot.invalidate();
    this.onCursor(this.words());
  }

  /** Moves the cursor to the next event, or to the one before it, and the paused plot with it.
   * @param {number} direction 1 or -1 */
  toEvent(direction) {
    const {stream, events} = this;
    if (!stream || !events) return;
    const {store} = stream, shown = store.at(this.edge() + 1);
    const from = this.cursor.index < store.first ? shown : this.cursor.index;
    const all = events.all.map((event) => Events.sample(event, store, stream.measured)).filter((index) => index >= 0);
    const ahead = all.filter((index) => (direction > 0 ? index > from : index < from));
    if (ahead.length === 0) return;
    const index = direction > 0 ? Math.min(...ahead) : Math.max(...ahead), time = store.time(index);
    if (time > this.edge() || time < this.edge() - this.seconds * 1e6) this.hold(time + this.seconds * 5e5);
    this.place(index, this.cursor.channel);
  }

  /** Descriptions of the events at the cursor's sample. */
  eventsAtCursor() {
    const {stream, events, cursor: {index}} = this;
    if (!stream || !events) return [];
    const time = stream.store.time(index), reach = 2e6 / stream.store.rate;
    const near = events.between(time - reach, time + reach);
    return near.filter((event) => Events.sample(event, stream.store, stream.measured) === index)
      .map((event) => event.description);
  }

  /** Describes the sample at the cursor with the digits that its value has at three decimals. */
  words() {
    const {stream, second} = this, {index, channel} = this.cursor, store = stream?.store;
    if (!store || index < store.first) return 'no sample at the cursor';
    const label = store.labels[channel], time = store.time(index);
    const [reference, other] = this.references;
    const isAverage = this.average && channel < store.electrodes;
    const to = isAverage ? ` to the average of ${reference.part.length} electrodes` : '';
    const words = [`${label} ${reference.value(index, channel).toFixed(3)} ${store.unit}${to} at ` +
      `${(time / 1e6).toFixed(6)} s`];
    if (second) {
      const at = second.store.nearest(time), row = second.store.labels.indexOf(label);
      const value = at < 0 || row < 0 ? 'no sample' : `${other.value(at, row).toFixed(3)} ${second.store.unit}`;
      const lost = at >= 0 && second.store.flag(at) & FILLER ? ' (was lost)' : '';
      words.push(`${second.name} ${value}${lost}`);
    }
    words.push(...this.eventsAtCursor());
    const flags = store.flag(index);
    if (flags & FILLER) words.push('replaced, was lost');
    if (flags & HEALING) words.push('decoded without its neighbours');
    if (this.substituted.has(label)) words.push(EXCLUDED[Number(stream.measured)]);
    return words.join('; ');
  }
}
