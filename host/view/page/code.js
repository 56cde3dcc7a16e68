// @ts-check
// Shows the numbers of the codes, how many bits they take, and how well the device computes them.

import {nice} from './axis.js';
import {find} from './element.js';
import {colour, fit} from './palette.js';
import {FILLER} from './store.js';

/** @typedef {import('./feed.js').Frame} Frame */
/** @typedef {import('./feed.js').Status} Status */

/** Codes in the picture: 16 s at 16 codes per second. */
const CODES = 256;
/** Bits of a number, and of what comes with the numbers of a code, by format.
 * @type {Record<string, [number, number]>} */
const BITS = {int8: [8, 0], 'int8-exponent': [8, 8], int16: [16, 0]};
/** Part of a logarithmic axis's end below which it is linear. */
const LINEAR = 1e-3;
/** Seconds of bits per second that are kept. */
const SECONDS = 120;

export class CodePanel {
  constructor() {
    /** @type {HTMLCanvasElement} */
    this.bars = find('numbers');
    /** @type {HTMLCanvasElement} */
    this.picture = find('codes');
    /** @type {HTMLCanvasElement} */
    this.rate = find('bits');
    /** @type {HTMLSelectElement} */
    this.axis = find('code-axis');
    this.axis.addEventListener('change', () => { this.changed = true; });
    /** The newest codes, the oldest first.
     * @type {{values: Float32Array, time: number, lost: boolean}[]} */
    this.codes = [];
    /** @type {string[]} */
    this.labels = [];
    this.unit = '';
    this.chosen = 0;
    this.changed = false;
    /** The picture with a pixel for each number, what its colours depend on, and the codes received so far. */
    this.pixels = document.createElement('canvas');
    this.drawn = {key: '', received: 0};
    this.received = 0;
    /** Bits per second of the packed code, by report.
     * @type {number[]} */
    this.bits = [];
    /** Bytes on the link in the report before, and when it came. */
    this.before = {bytes: NaN, at: 0};
    this.bars.addEventListener('mousemove', (event) => {
      this.choose(Math.floor(event.offsetX / this.bars.clientWidth * this.labels.length));
    });
    this.bars.addEventListener('keydown', (event) => {
      const steps = Number(event.key === 'ArrowRight') - Number(event.key === 'ArrowLeft');
      if (steps === 0) return;
      event.preventDefault();
      this.choose(this.chosen + steps * (event.shiftKey ? 10 : 1));
    });
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { this.changed = true; });
    for (const canvas of [this.bars, this.picture]) new ResizeObserver(() => { this.changed = true; }).observe(canvas);
  }

  /** Forgets what a bridge that was lost has reported. */
  clear() {
    this.before = {bytes: NaN, at: 0};
    this.bits = [];
    this.figures([]);
  }

  /** @param {number} number of the code whose value is shown in digits */
  choose(number) {
    this.chosen = Math.min(this.labels.length - 1, Math.max(0, number));
    this.changed = true;
  }

  /** Notes a code.
   * @param {Frame} frame */
  code(frame) {
    if (frame.eeg.labels.join() !== this.labels.join()) {
      this.codes = [];
      this.labels = frame.eeg.labels;
      this.chosen = 0;
    }
    this.unit = frame.eeg.unit;
    const time = frame.tri[3] + 65536 * frame.tri[4] + 4294967296 * frame.tri[5];
    this.codes.push({values: frame.eegData, time, lost: (frame.tri[0] & FILLER) !== 0});
    if (this.codes.length > CODES) this.codes.shift();
    this.received += 1;
    this.changed = true;
  }

  /** @param {Status[]} statuses @param {number} now milliseconds */
  report(statuses, now) {
    /** @param {string} name @param {string} key */
    const value = (name, key) => statuses.find((status) => status.name === name)?.values.get(key);
    /** @type {[string, string | undefined][]} */
    const figures = [];
    const [each, more] = BITS[value('device', 'code format') ?? ''] ?? [NaN, NaN], {codes} = this;
    const span = codes.length > 1 ? (codes[codes.length - 1].time - codes[0].time) / 1e6 : 0;
    if (span > 0 && each > 0) {
      const received = codes.slice(1).filter(({lost}) => !lost).length;
      const bits = (each * this.labels.length + more) * received / span;
      figures.push([`codes, ${this.labels.length} numbers, bits/s`, bits.toFixed(0)]);
    }
    figures.push(['packed code, bits/s', value('packed code', 'bits per second')],
      ['packed rate', value('packed code', 'rate')]);
    const bytes = Number(value('link', 'bytes') ?? NaN);
    if (bytes > this.before.bytes) {
      figures.push(['whole link, bits/s', (8000 * (bytes - this.before.bytes) / (now - this.before.at)).toFixed(0)]);
    }
    this.before = {bytes, at: now};
    figures.push(['audit: RMS error, levels', limited(value('audit', 'rms levels'), value('audit', 'rms limit'))],
      ['audit: largest error, levels', limited(value('audit', 'largest levels'), value('audit', 'largest limit'))],
      ['audit: packed error, uV RMS', value('audit', 'packed: error uV RMS')],
      ['audit: error of the variance', value('audit', 'packed: error of the variance')],
      ['blocks that do not fit (misfits)', value('packed code', 'misfits')],
      ['blocks too long: coarser', value('packed code', 'too long, coarser')],
      ['blocks too long: no content', value('packed code', 'too long, no content')],
      ['code values clipped', value('loss', 'code values clipped')]);
    this.figures(figures.flatMap(([name, text]) => (text === undefined ? [] : [[name, text]])));
    const bits = Number(value('packed code', 'bits per second') ?? NaN);
    if (bits >= 0) this.bits.push(bits);
    if (this.bits.length > SECONDS) this.bits.shift();
    this.rate.hidden = this.bits.length === 0;
    if (!this.rate.hidden) this.line();
  }

  /** @param {string[][]} figures */
  figures(figures) {
    find('code-figures').replaceChildren(...figures.flatMap((pair) => pair.map((text, k) => {
      const node = document.createElement(k === 0 ? 'dt' : 'dd');
      node.textContent = text;
      return node;
    })));
  }

  /** Draws a new code; called for each frame of the screen. */
  draw() {
    const newest = this.codes[this.codes.length - 1];
    for (const canvas of [this.bars, this.picture]) canvas.hidden = !newest;
    if (!this.changed || !newest || this.bars.clientWidth === 0) return;
    this.changed = false;
    const {values, time, lost} = newest;
    find('code-cursor').textContent = `${this.labels[this.chosen]} ${digits(values[this.chosen])} ${this.unit} at ` +
      `${(time / 1e6).toFixed(6)} s${lost ? '; replaced, was lost' : ''}`;
    const span = (time - this.codes[0].time) / 1e6;
    find('codes-note').textContent = `below: newest ${this.codes.length} codes, ${span.toFixed(1)} s, a row per number`;
    let most = 0;
    for (const code of this.codes) for (const value of code.values) most = Math.max(most, Math.abs(value));
    const range = most > 0 ? nice(most) : 1;
    this.drawBars(values, range);
    this.drawPicture(range);
  }

  /**
   * Place of a value on the axis, from -1 to 1. The logarithmic one is linear near 0: the numbers of a
   * linear code differ by three orders of magnitude.
   * @param {number} value
   * @param {number} range end of the axis
   */
  place(value, range) {
    const part = Math.min(1, Math.abs(value) / range), isLinear = this.axis.value === 'linear';
    return Math.sign(value) * (isLinear ? part : Math.log1p(part / LINEAR) / Math.log1p(1 / LINEAR));
  }

  /**
   * @param {Float32Array} values
   * @param {number} range of the axis, to both sides of 0
   */
  drawBars(values, range) {
    const context = fit(this.bars), {width, height} = this.bars, ratio = devicePixelRatio;
    const each = width / values.length, middle = Math.round(height / 2);
    context.fillStyle = colour('ground').css;
    context.fillRect(0, 0, width, height);
    context.fillStyle = colour('line').css;
    for (const part of this.axis.value === 'linear' ? [-0.5, 0.5] : [-0.1, -0.01, 0.01, 0.1]) {
      context.fillRect(0, Math.round(middle - this.place(part * range, range) * (height / 2)), width, 1);
    }
    values.forEach((value, k) => {
      context.fillStyle = colour(k === this.chosen ? 'chosen' : value < 0 ? 'trace' : 'over').css;
      const [x, end] = [Math.round(k * each), Math.round((k + 1) * each)], length = this.place(value, range) * height / 2;
      const bar = Math.max(1, end - x - (each > 3 ? 1 : 0));
      context.fillRect(x, Math.min(middle, middle - length), bar, Math.max(1, Math.abs(length)));
    });
    context.fillStyle = colour('line').css;
    context.fillRect(0, middle, width, 1);
    context.fillStyle = colour('faint').css;
    context.font = `${10 * ratio}px "DejaVu Sans", sans-serif`;
    context.textBaseline = 'top';
    context.fillText(`+${range} ${this.unit}`, 2 * ratio, 1 * ratio);
    context.textBaseline = 'bottom';
    context.fillText(`-${range}`, 2 * ratio, height);
  }

  /** Draws a column for each code and a row for each number.
   * @param {number} range */
  drawPicture(range) {
    const rows = this.labels.length, key = `${rows} ${range} ${this.axis.value} ${colour('ground').css}`;
    const from = key === this.drawn.key ? Math.min(this.codes.length, this.received - this.drawn.received) : CODES;
    this.drawn = {key, received: this.received};
    const small = this.pixels;
    const context = /** @type {CanvasRenderingContext2D} */ (small.getContext('2d', {alpha: false}));
    if (small.height !== rows) [small.width, small.height] = [CODES, rows];
    if (from > 0) this.addColumns(context, from, range);
    const shown = fit(this.picture);
    shown.imageSmoothingEnabled = false;
    shown.drawImage(small, 0, 0, this.picture.width, this.picture.height);
  }

  /**
   * Moves older codes to the left, and draws the newest ones.
   * @param {CanvasRenderingContext2D} context
   * @param {number} from number of new columns
   * @param {number} range
   */
  addColumns(context, from, range) {
    const rows = this.labels.length, [ground, filler] = [colour('ground'), colour('filler')];
    const ends = [colour('trace'), colour('over')];
    context.drawImage(context.canvas, -from, 0);
    const image = context.createImageData(from, rows), pixels = new Uint32Array(image.data.buffer);
    pixels.fill(ground.word);
    this.codes.slice(-from).forEach(({values, lost}, k, {length}) => {
      for (let row = 0; row < rows; row += 1) {
        const part = Math.abs(this.place(values[row], range)), end = ends[Number(values[row] >= 0)];
        /** @param {'red' | 'green' | 'blue'} name */
        const mix = (name) => Math.round(ground[name] + (end[name] - ground[name]) * part);
        const word = lost ? filler.word : (255 << 24 | mix('blue') << 16 | mix('green') << 8 | mix('red')) >>> 0;
        pixels[row * from + from - length + k] = word;
      }
    });
    context.putImageData(image, CODES - from, 0);
  }

  /** Draws the bits per second of the packed code over the newest reports. */
  line() {
    const context = fit(this.rate), {width, height} = this.rate, ratio = devicePixelRatio;
    const most = nice(Math.max(1, ...this.bits));
    context.fillStyle = colour('ground').css;
    context.fillRect(0, 0, width, height);
    context.strokeStyle = colour('trace').css;
    context.lineWidth = ratio;
    context.beginPath();
    this.bits.forEach((bits, k) => {
      const x = width * (1 - (this.bits.length - 1 - k) / (SECONDS - 1));
      context.lineTo(x, height - 1 - bits / most * (height - 2));
    });
    context.stroke();
    context.fillStyle = colour('faint').css;
    context.font = `${10 * ratio}px "DejaVu Sans", sans-serif`;
    context.textBaseline = 'top';
    context.fillText(`${most / 1000} kbit/s`, 2 * ratio, 1 * ratio);
  }
}

/** @param {string | undefined} value @param {string | undefined} limit */
function limited(value, limit) { return value === undefined ? undefined : `${value} (limit ${limit})`; }

/**
 * The fewest digits that stand for this number and no other one of 32 bits.
 * @param {number} value
 */
function digits(value) {
  const texts = [6, 7, 8, 9].map((count) => Number(value.toPrecision(count)));
  return String(texts.find((one) => Math.fround(one) === value) ?? value);
}
