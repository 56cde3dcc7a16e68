// @ts-check
// The bar that scrolls through what the store has kept.

import {find} from './element.js';

/** @typedef {import('./traces.js').Traces} Traces */

/** Most bytes of the history of one stream: an hour of 64 channels at 512 Hz takes 492 MB. Where the main
 * pointer is a finger, as on tablets, or the browser tells that the machine has at most 4 GB. */
const MOST_BYTES = 512 * 2 ** 20, FEW_BYTES = 64 * 2 ** 20, LITTLE_GB = 4;

/** Most bytes that a stream's history may take on this machine. */
export function mostBytes() {
  const memory = /** @type {{deviceMemory?: number}} */ (navigator).deviceMemory ?? Infinity;
  return memory <= LITTLE_GB || matchMedia('(pointer: coarse)').matches ? FEW_BYTES : MOST_BYTES;
}

export class History {
  /** @param {Traces} traces @param {() => void} onHold called when the user scrolls */
  constructor(traces, onHold) {
    this.traces = traces;
    /** @type {HTMLInputElement} */
    this.bar = find('history');
    this.kept = find('kept');
    this.shown = '';
    this.bar.addEventListener('input', () => {
      traces.hold(Number(this.bar.value) * 1e6);
      onHold();
    });
  }

  /** Shows what is kept and what part of it is on the plot. */
  update() {
    const {store, held} = this.traces;
    if (!store || store.next === store.first) return;
    const [from, to] = [store.begun(), store.end()], edge = Math.min(to, held ?? to);
    const before = Math.round((to - edge) / 1e6);
    const shown = `${Math.floor(from / 1e6)} ${held === null ? Math.floor(to / 1e6) : held} ${Math.floor(to / 1e6)}`;
    if (shown === this.shown) return;
    this.shown = shown;
    this.bar.min = (from / 1e6).toFixed(1);
    this.bar.max = (to / 1e6).toFixed(1);
    this.bar.value = (edge / 1e6).toFixed(1);
    this.bar.setAttribute('aria-valuetext', before > 0 ? `${before} s before the newest sample` : 'newest sample');
    const most = Math.floor(store.most * store.chunkBytes / 2 ** 20), hour = Math.floor(store.longest / 60);
    this.kept.textContent = `${before > 0 ? `${duration(before)} back; ` : ''}${duration((to - from) / 1e6)} kept ` +
      `of at most ${hour} min, ${(store.bytes / 2 ** 20).toFixed(0)} of ${most} MiB`;
  }
}

/** @param {number} seconds */
function duration(seconds) {
  const whole = Math.round(seconds);
  return whole < 120 ? `${whole} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}
