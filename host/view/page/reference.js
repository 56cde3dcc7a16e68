// @ts-check
// The values of a store as they were received, or with the average of the electrodes subtracted.

/** @typedef {import('./store.js').Store} Store */

export class Reference {
  /**
   * @param {Store} store
   * @param {boolean} average whether the mean of the electrodes is subtracted from each of them
   * @param {Set<string>} excluded labels of electrodes that are no part of the mean
   */
  constructor(store, average, excluded) {
    this.store = store;
    this.average = average;
    /** Channels of the mean. */
    this.part = Uint16Array.from([...store.labels.keys()].filter((channel) =>
      channel < store.electrodes && !excluded.has(store.labels[channel])));
  }

  /** Mean that is subtracted at a sample; 0 for values as received.
   * @param {number} index */
  mean(index) {
    if (!this.average || this.part.length === 0) return 0;
    const {values} = this.store.chunk(index), row = this.store.row(index);
    let sum = 0;
    for (let i = 0; i < this.part.length; i += 1) sum += values[row + this.part[i]];
    return sum / this.part.length;
  }

  /** @param {number} index @param {number} channel */
  value(index, channel) {
    const value = this.store.value(index, channel);
    return channel < this.store.electrodes ? value - this.mean(index) : value;
  }
}
