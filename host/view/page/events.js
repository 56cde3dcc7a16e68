// @ts-check
// The events that the bridge has published, and their samples.

import {readEvent} from './feed.js';

/** @typedef {import('./feed.js').Reader} Reader */
/** @typedef {import('./feed.js').DeviceEvent} DeviceEvent */
/** @typedef {import('./store.js').Store} Store */

/** Most events that are kept: an hour of three a second. */
const MOST = 10800;
/** Code of a rising edge of the trigger input, and the bit of a falling one. */
export const TRIGGER = 1, END = 0x8000;
/** Events of the last so many milliseconds can belong to a run of the device that begins now, if they are
 * in its first so many microseconds. */
const RECENT_MS = 5000, FIRST_US = 5e6;

export class Events {
  constructor() {
    /** In the order of their device times.
     * @type {(DeviceEvent & {received: number})[]} */
    this.all = [];
    /** Number of events without a device time. */
    this.unplaced = 0;
  }

  /** @param {Reader} body @returns {DeviceEvent} the event */
  add(body) {
    const event = readEvent(body);
    if (event.time < 0) {
      this.unplaced += 1;
      return event;
    }
    let at = this.all.length;
    while (at > 0 && this.all[at - 1].time > event.time) at -= 1;
    this.all.splice(at, 0, {...event, received: performance.now()});
    if (this.all.length > MOST) this.all.shift();
    return event;
  }

  /** The device counts its time from 0 again: forgets the events of the run before. */
  restart() {
    const recent = performance.now() - RECENT_MS;
    this.all = this.all.filter((event) => event.received > recent && event.time < FIRST_US);
  }

  /**
   * Index of the sample of an event: the first one at its time or later; of an edge in a measured stream,
   * the one at which the trigger changes. -1 if the store does not have it.
   * @param {DeviceEvent} event @param {Store} store @param {boolean} measured
   */
  static sample(event, store, measured) {
    if (store.next === store.first || event.time < store.begun()) return -1;
    const index = store.at(event.time);
    if (measured && (event.code & ~END) === TRIGGER) {
      const level = event.code & END ? 0 : 1;
      for (let i = Math.max(store.first + 1, index - 1); i < Math.min(store.next, index + 2); i += 1) {
        if (store.trigger(i) === level && store.trigger(i - 1) !== level) return i;
      }
    }
    return index < store.next ? index : -1;
  }

  /** @param {number} from @param {number} to device times @returns {DeviceEvent[]} events in `from..to` */
  between(from, to) {
    let [low, high] = [0, this.all.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.all[middle].time < from) low = middle + 1;
      else high = middle;
    }
    let end = low;
    while (end < this.all.length && this.all[end].time <= to) end += 1;
    return this.all.slice(low, end);
  }
}
