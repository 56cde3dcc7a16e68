// @ts-check
// The newest minute of one stream, as received.

/** @typedef {import('./feed.js').Frame} Frame */

/** Length of the store, seconds. 64 channels at 512 Hz take 8 MB. */
const SECONDS = 60;
/** Step back of device time from which the device has restarted, microseconds. */
const RESTART_US = 1e6;
/** Bits of a sample's flags that the bridge sets. */
export const FILLER = 0x8000, HEALING = 0x4000;

export class Store {
  /** @param {Frame} frame the first frame of the stream */
  constructor(frame) {
    this.labels = [...frame.eeg.labels, ...frame.exg.labels];
    this.electrodes = frame.eeg.labels.length;
    this.unit = frame.eeg.unit;
    this.transducer = frame.eeg.transducer;
    this.rate = frame.rate;
    this.capacity = SECONDS * frame.rate;
    this.channels = this.labels.length;
    this.values = new Float32Array(this.capacity * this.channels);
    /** Device time, microseconds, never decreasing. */
    this.times = new Float64Array(this.capacity);
    this.flags = new Uint16Array(this.capacity);
    this.triggers = new Uint8Array(this.capacity);
    /** Index of the oldest sample kept, and of the next one; an index counts all samples received. */
    this.first = 0;
    this.next = 0;
    this.fillers = 0;
  }

  /** @param {Frame} frame @returns {boolean} whether the frame has the shape of this store */
  fits(frame) {
    const labels = [...frame.eeg.labels, ...frame.exg.labels];
    return frame.rate === this.rate && frame.eeg.transducer === this.transducer &&
      labels.length === this.channels && labels.every((label, i) => label === this.labels[i]);
  }

  /** @param {Frame} frame */
  append(frame) {
    const [eeg, exg] = [frame.eeg.nchannels, frame.exg.nchannels];
    for (let s = 0; s < frame.eeg.nsamples; s += 1) {
      const tri = 8 * s;
      let time = frame.tri[tri + 3] + 65536 * frame.tri[tri + 4] + 4294967296 * frame.tri[tri + 5];
      const last = this.end();
      // The device has restarted: its time begins again. A smaller step back has another cause, such as
      // packed blocks after codes, whose first steps were decoded before.
      if (time < last - RESTART_US) this.first = this.next;
      else time = Math.max(time, last);
      const slot = this.next % this.capacity, at = slot * this.channels;
      this.values.set(frame.eegData.subarray(s * eeg, (s + 1) * eeg), at);
      this.values.set(frame.exgData.subarray(s * exg, (s + 1) * exg), at + eeg);
      this.times[slot] = time;
      this.flags[slot] = frame.tri[tri];
      this.triggers[slot] = frame.tri[tri + 7];
      if (frame.tri[tri] & FILLER) this.fillers += 1;
      this.next += 1;
      this.first = Math.max(this.first, this.next - this.capacity);
    }
  }

  /** @param {number} index @param {number} channel */
  value(index, channel) { return this.values[(index % this.capacity) * this.channels + channel]; }
  /** @param {number} index */
  time(index) { return this.times[index % this.capacity]; }
  /** @param {number} index */
  flag(index) { return this.flags[index % this.capacity]; }
  /** @param {number} index */
  trigger(index) { return this.triggers[index % this.capacity]; }
  /** Device time of the newest sample; 0 without samples. */
  end() { return this.next > this.first ? this.time(this.next - 1) : 0; }

  /** @param {number} time @returns {number} index of the first sample at `time` or later */
  at(time) {
    let [low, high] = [this.first, this.next];
    while (low < high) {
      const middle = Math.floor((low + high) / 2);
      if (this.time(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}
