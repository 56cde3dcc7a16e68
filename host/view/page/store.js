// @ts-check
// The newest hour of one stream, as received, in chunks.

/** @typedef {import('./feed.js').Frame} Frame */

/**
 * Samples of one stream that follow each other.
 * @typedef {{values: Float32Array, times: Float64Array, flags: Uint16Array, triggers: Uint8Array}} Chunk
 * `values` is sample-major, `times` is device time in microseconds
 */

/** Longest history, seconds. */
const SECONDS = 3600;
/** Samples in a chunk, a power of two; 1.1 MB with 64 channels. */
const SIZE = 4096, SHIFT = 12, MASK = SIZE - 1;
/** Bytes of a sample besides its values: time, flags and trigger. */
const SAMPLE_BYTES = 11;
/** Step back of device time from which the device has restarted, microseconds. */
const RESTART_US = 1e6;
/** Bits of a sample's flags that the bridge sets. */
export const FILLER = 0x8000, HEALING = 0x4000;

export class Store {
  /**
   * @param {Frame} frame the first frame of the stream
   * @param {number} most bytes of the history; the oldest chunk makes room for a new one
   */
  constructor(frame, most) {
    this.labels = [...frame.eeg.labels, ...frame.exg.labels];
    this.electrodes = frame.eeg.labels.length;
    this.unit = frame.eeg.unit;
    this.transducer = frame.eeg.transducer;
    this.rate = frame.rate;
    this.channels = this.labels.length;
    this.chunkBytes = SIZE * (4 * this.channels + SAMPLE_BYTES);
    /** Most chunks that are kept: one more than an hour takes, so that an hour is complete. */
    this.most = Math.max(2, Math.min(Math.ceil(SECONDS * this.rate / SIZE) + 1, Math.floor(most / this.chunkBytes)));
    /** Seconds that are complete when all chunks are full. */
    this.longest = Math.min(SECONDS, (this.most - 1) * SIZE / this.rate);
    /** Chunk `n` has the samples from index `n * SIZE`, and is at `n` modulo the number of places. A place
     * stays empty until its samples arrive.
     * @type {(Chunk | undefined)[]} */
    this.places = new Array(this.most).fill(undefined);
    /** Number of chunks in memory. */
    this.chunks = 0;
    /** Index of the oldest sample kept, and of the next one; an index counts all samples received, below
     * 2^32, which is 97 days at 512 Hz. */
    this.first = 0;
    this.next = 0;
    this.fillers = 0;
    /** Number of restarts of the device that its time tells. */
    this.restarts = 0;
  }

  /** Bytes in use. */
  get bytes() { return this.chunks * this.chunkBytes; }

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
      if (time < last - RESTART_US) {
        this.first = this.next;
        this.restarts += 1;
      } else time = Math.max(time, last);
      const slot = this.next & MASK, at = slot * this.channels;
      const chunk = slot === 0 ? this.begin() : this.chunk(this.next);
      chunk.values.set(frame.eegData.subarray(s * eeg, (s + 1) * eeg), at);
      chunk.values.set(frame.exgData.subarray(s * exg, (s + 1) * exg), at + eeg);
      chunk.times[slot] = time;
      chunk.flags[slot] = frame.tri[tri];
      chunk.triggers[slot] = frame.tri[tri + 7];
      if (frame.tri[tri] & FILLER) this.fillers += 1;
      this.next += 1;
    }
  }

  /** Begins the next chunk: in new memory, or in that of the oldest chunk.
   * @returns {Chunk} */
  begin() {
    const number = this.next >>> SHIFT, place = number % this.most;
    let chunk = this.places[place];
    if (!chunk) {
      try {
        chunk = {
          values: new Float32Array(SIZE * this.channels), times: new Float64Array(SIZE),
          flags: new Uint16Array(SIZE), triggers: new Uint8Array(SIZE),
        };
        this.chunks += 1;
      } catch {
        // No memory is left: the history stays as long as it is.
        const oldest = Math.max(0, number - this.chunks), from = oldest % this.most;
        chunk = this.places[from];
        if (!chunk) throw new RangeError('no memory for the first samples of a stream');
        this.places[from] = undefined;
      }
      this.places[place] = chunk;
    }
    this.first = Math.max(this.first, (number + 1 - this.chunks) * SIZE);
    return chunk;
  }

  /** @param {number} index @returns {Chunk} the chunk of a sample that is kept */
  chunk(index) { return /** @type {Chunk} */ (this.places[(index >>> SHIFT) % this.most]); }
  /** @param {number} index @param {number} channel */
  value(index, channel) { return this.chunk(index).values[(index & MASK) * this.channels + channel]; }
  /** @param {number} index */
  time(index) { return this.chunk(index).times[index & MASK]; }
  /** @param {number} index */
  flag(index) { return this.chunk(index).flags[index & MASK]; }
  /** @param {number} index */
  trigger(index) { return this.chunk(index).triggers[index & MASK]; }
  /** Device time of the newest sample; 0 without samples. */
  end() { return this.next > this.first ? this.time(this.next - 1) : 0; }
  /** Device time of the oldest sample; 0 without samples. */
  begun() { return this.next > this.first ? this.time(this.first) : 0; }

  /** @param {number} index @returns {number} place of the sample's first value in its chunk */
  row(index) { return (index & MASK) * this.channels; }

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

  /** @param {number} index @returns {boolean} whether samples are missing before this one */
  gap(index) { return this.time(index) - this.time(index - 1) > 2.5e6 / this.rate; }

  /**
   * Index of the sample nearest to a device time, -1 if none is within half a sample.
   * @param {number} time
   */
  nearest(time) {
    const half = 0.5e6 / this.rate, index = this.at(time - half);
    return index < this.next && this.time(index) <= time + half ? index : -1;
  }
}
