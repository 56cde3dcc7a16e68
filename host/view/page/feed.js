// @ts-check
// Reads the stream of messages of the bridge, and decodes the ROS 1 serialisation of their bodies.

/** Bytes of topics, as in `ViewTopic`. */
export const DROPPED = 0, ENCODED = 1, RECONSTRUCTED = 2, FILTERED = 3, RAW = 4, DIAGNOSTICS = 5, EVENTS = 6;

/** Longest accepted message, bytes. Frames have at most 18 KB. */
const MAX_MESSAGE = 1 << 20;
/** Time without a message after which the bridge counts as lost, milliseconds: it reports each second. */
const SILENCE_MS = 5000;

/**
 * @typedef {{nsamples: number, nchannels: number, unit: string, transducer: string, labels: string[]}} Info
 * @typedef {{seq: number, rate: number, eeg: Info, eegData: Float32Array, exg: Info, exgData: Float32Array,
 *   tri: Int32Array}} Frame `data` is sample-major; `tri` has eight words per sample
 * @typedef {{level: number, name: string, message: string, values: Map<string, string>}} Status
 * @typedef {{time: number, code: number, duration: number, description: string}} DeviceEvent `time` is device
 *   time in microseconds, -1 if the bridge does not know it; `duration` in seconds
 * @typedef {{topic: number, publishedUs: number, body: Reader}} Message
 */

/** Reads fields in order, little-endian; strings and arrays follow their length. */
export class Reader {
  /** @param {Uint8Array} bytes */
  constructor(bytes) {
    this.bytes = bytes;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    this.at = 0;
  }
  /** @param {number} count @returns {number} offset of the next `count` bytes, which are skipped */
  skip(count) {
    const at = this.at;
    if (at + count > this.bytes.length) throw new RangeError('the message is too short');
    this.at += count;
    return at;
  }
  u8() { return this.view.getUint8(this.skip(1)); }
  u16() { return this.view.getUint16(this.skip(2), true); }
  u32() { return this.view.getUint32(this.skip(4), true); }
  i32() { return this.view.getInt32(this.skip(4), true); }
  f32() { return this.view.getFloat32(this.skip(4), true); }
  u64() { return Number(this.view.getBigUint64(this.skip(8), true)); }
  text() {
    const length = this.u32();
    const at = this.skip(length);
    return new TextDecoder().decode(this.bytes.subarray(at, at + length));
  }
  /** @template T @param {() => T} read @returns {T[]} */
  list(read) {
    const length = this.u32();
    const all = [];
    for (let i = 0; i < length; i += 1) all.push(read());
    return all;
  }
  /** @returns {ArrayBuffer} the bytes of an array of numbers of four bytes */
  words() {
    const bytes = 4 * this.u32();
    const at = this.skip(bytes) + this.bytes.byteOffset;
    return /** @type {ArrayBuffer} */ (this.bytes.buffer.slice(at, at + bytes));
  }
  /** @returns {{stampUs: number, frameId: string}} */
  header() {
    this.skip(4);
    const stampUs = 1e6 * this.u32() + this.u32() / 1000;
    return {stampUs, frameId: this.text()};
  }
}

/** @param {Reader} r @returns {Info} */
function readInfo(r) {
  const nsamples = r.u16(), nchannels = r.u16();
  r.u16();
  const unit = r.text(), transducer = r.text();
  r.text();
  r.u8();
  r.skip(8 * r.u32());
  return {nsamples, nchannels, unit, transducer, labels: r.list(() => r.text())};
}

/** @param {Reader} r @returns {Frame} */
export function readFrame(r) {
  r.header();
  const seq = r.u32(), rate = r.u16();
  const eeg = readInfo(r), eegData = new Float32Array(r.words());
  const exg = readInfo(r), exgData = new Float32Array(r.words());
  readInfo(r);
  return {seq, rate, eeg, eegData, exg, exgData, tri: new Int32Array(r.words())};
}

/** @param {Reader} r @returns {DeviceEvent} */
export function readEvent(r) {
  // The bridge puts the device time in the place of the stamp, and says so in `frame_id`.
  const {stampUs, frameId} = r.header();
  r.skip(4);
  r.text();
  const code = r.i32(), duration = r.f32();
  r.skip(4);
  return {time: frameId === 'device' ? stampUs : -1, code, duration, description: r.text()};
}

/** @param {Reader} r @returns {Status[]} without what precedes `: ` in their names */
export function readStatus(r) {
  r.header();
  return r.list(() => {
    const level = r.u8(), name = r.text().replace(/^.*?: /, ''), message = r.text();
    r.text();
    return {level, name, message, values: new Map(r.list(() => /** @type {[string, string]} */ ([r.text(), r.text()])))};
  });
}

/**
 * Receives messages until the bridge is lost. The promise is resolved with the HTTP status, 0 if no
 * answer came.
 * @param {string} token or nothing
 * @param {() => void} onOpen
 * @param {(message: Message) => void} onMessage
 * @returns {Promise<number>}
 */
export async function receive(token, onOpen, onMessage) {
  const abort = new AbortController();
  let silence = setTimeout(() => abort.abort(), SILENCE_MS);
  let status = 0;
  try {
    const headers = /** @type {Record<string, string>} */ (token ? {Authorization: `Bearer ${token}`} : {});
    const response = await fetch('/stream', {headers, signal: abort.signal, cache: 'no-store'}).catch(() => null);
    if (!response) return status;
    status = response.status;
    if (!response.ok || !response.body) return status;
    onOpen();
    const reader = response.body.getReader();
    let rest = new Uint8Array(0);
    for (;;) {
      const part = await reader.read().catch(() => null);
      if (!part?.value) return status;
      const value = part.value;
      clearTimeout(silence);
      silence = setTimeout(() => abort.abort(), SILENCE_MS);
      const bytes = new Uint8Array(rest.length + value.length);
      bytes.set(rest);
      bytes.set(value, rest.length);
      rest = consume(bytes, onMessage);
    }
  } catch (error) {
    console.error(error);
    return status;
  } finally {
    clearTimeout(silence);
    abort.abort();
  }
}

/** @param {Uint8Array} bytes @param {(message: Message) => void} onMessage @returns {Uint8Array} the rest */
function consume(bytes, onMessage) {
  const r = new Reader(bytes);
  while (bytes.length - r.at >= 4) {
    const at = r.at, length = r.u32();
    if (length > MAX_MESSAGE) throw new RangeError(`a message of ${length} bytes`);
    if (bytes.length - r.at < length) {
      r.at = at;
      break;
    }
    const start = r.skip(length);
    const body = new Reader(bytes.subarray(start, start + length));
    onMessage({topic: body.u8(), publishedUs: body.u64(), body});
  }
  return bytes.slice(r.at);
}
