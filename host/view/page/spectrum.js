// @ts-check
// Estimates the spectrum of the stream on the plot by Welch's method, in the pauses between drawings.

import {FILLER} from './store.js';
import {Periodogram} from './welch.js';

/** @typedef {import('./reference.js').Reference} Reference */
/** @typedef {import('./store.js').Store} Store */

/** Most segments in a spectrum, 16 s if none is left out: they have 2 s and overlap by half. Those that are
 * used are among the newest `REACH`, so of the newest minute. */
const SEGMENTS = 15, REACH = 60;
/** Bands of EEG: name, and frequencies from which and below which they reach, Hz.
 * @type {[string, number, number][]} */
export const BANDS = [['delta', 1, 4], ['theta', 4, 8], ['alpha', 8, 13], ['beta', 13, 30], ['gamma', 30, 45]];

/**
 * Mean density of the segments that were used. `density` has `bins` values for each channel of the store.
 * @typedef {{density: Float64Array, bins: number, step: number, used: number, from: number, to: number,
 *   length: number, leftOut: number}} Result `leftOut` is the number of segments with fillers or gaps among
 *   those that are used; `from` and `to` are the device times of the first and the last sample, microseconds
 */

export class Spectrum {
  constructor() {
    /** @type {Reference | null} */
    this.reference = null;
    /** What the values of a segment depend on. */
    this.key = '';
    this.periodogram = new Periodogram(128);
    /** Segment `k` begins with the sample of index `k` times half its length; null with fillers or a gap.
     * @type {Map<number, {done: Uint8Array, density: Float32Array} | null>} */
    this.segments = new Map();
    this.samples = new Float64Array(0);
    this.means = new Float64Array(0);
  }

  /** @param {Reference} reference whose values are analysed */
  use(reference) {
    const {store, average, part} = reference;
    const key = average ? part.join() : '';
    if (this.reference?.store !== store || this.key !== key) {
      if (this.periodogram.rate !== store.rate) this.periodogram = new Periodogram(store.rate);
      this.segments.clear();
      this.samples = new Float64Array(this.periodogram.length);
      this.means = new Float64Array(this.periodogram.length);
    }
    this.reference = reference;
    this.key = key;
  }

  /**
   * Numbers of the newest segments without fillers up to the device time `edge`, the oldest first, and the
   * number of those that are left out.
   * @param {Store} store
   * @param {number} edge
   */
  wanted(store, edge) {
    const {length, bins} = this.periodogram, half = length / 2;
    const last = Math.floor((store.at(edge + 1) - length) / half);
    const first = Math.max(Math.ceil(store.first / half), last - REACH + 1);
    for (const k of this.segments.keys()) if (k < first || k > last) this.segments.delete(k);
    /** @type {number[]} */
    const used = [];
    let leftOut = 0;
    for (let k = last, passed = 0; k >= first && used.length < SEGMENTS; k -= 1) {
      if (!this.segments.has(k)) {
        this.segments.set(k, this.isWhole(store, k * half) ?
          {done: new Uint8Array(store.channels), density: new Float32Array(store.channels * bins)} : null);
      }
      if (this.segments.get(k)) {
        used.unshift(k);
        leftOut += passed;
        passed = 0;
      } else passed += 1;
    }
    return {used, leftOut};
  }

  /**
   * Goes on with the work. Returns the spectrum once it is complete.
   * @param {number} edge device time of the newest sample that takes part @param {number[]} channels
   * @param {number} until time at which work is left for the next call, milliseconds
   * @returns {Result | null}
   */
  work(edge, channels, until) {
    const {reference, periodogram, segments} = this;
    if (!reference) return null;
    const {store} = reference, {length, bins, step} = periodogram, half = length / 2;
    const {used, leftOut} = this.wanted(store, edge), density = new Float64Array(store.channels * bins);
    for (const k of used) {
      const segment = segments.get(k), missing = segment ? channels.filter((channel) => !segment.done[channel]) : [];
      if (!segment || missing.length === 0) continue;
      this.read(k * half, null);
      for (const channel of missing) {
        if (performance.now() > until) return null;
        this.read(k * half, channel);
        periodogram.density(this.samples, segment.density.subarray(channel * bins, (channel + 1) * bins));
        segment.done[channel] = 1;
      }
    }
    for (const one of used.flatMap((k) => segments.get(k) ?? [])) {
      for (const channel of channels) {
        for (let n = channel * bins; n < (channel + 1) * bins; n += 1) density[n] += one.density[n] / used.length;
      }
    }
    const [from, to] = used.length === 0 ? [0, 0] :
      [store.time(used[0] * half), store.time(used[used.length - 1] * half + length - 1)];
    return {density, bins, step, used: used.length, leftOut, from, to, length};
  }

  /** Whether a segment has neither fillers nor gaps.
   * @param {Store} store @param {number} first */
  isWhole(store, first) {
    const {length, rate} = this.periodogram;
    for (let i = first; i < first + length; i += 1) if (store.flag(i) & FILLER) return false;
    const duration = store.time(first + length - 1) - store.time(first);
    return Math.abs(duration * rate / 1e6 - (length - 1)) < 1.5;
  }

  /** Reads the samples of a channel, or, without one, the means that are subtracted from them.
   * @param {number} first @param {number | null} channel */
  read(first, channel) {
    const reference = /** @type {Reference} */ (this.reference), {store} = reference;
    for (let n = 0; n < this.samples.length; n += 1) {
      if (channel === null) this.means[n] = reference.mean(first + n);
      else this.samples[n] = store.value(first + n, channel) - (channel < store.electrodes ? this.means[n] : 0);
    }
  }
}

/** Powers of the bands: sums of the density over their frequencies, times the distance of these. NaN for a
 * band that reaches beyond half the rate.
 * @param {Result} result @param {number} channel */
export function bandPowers({density, bins, step}, channel) {
  return BANDS.map(([, from, to]) => {
    let sum = to > (bins - 1) * step ? NaN : 0;
    for (let n = Math.ceil(from / step); n < to / step; n += 1) sum += density[channel * bins + n] * step;
    return sum;
  });
}
