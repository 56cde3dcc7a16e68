// @ts-check
// Shows the spectrum of the stream on the plot, its bands, and the value at a frequency.

import {nice} from './axis.js';
import {find} from './element.js';
import {colour, fit} from './palette.js';
import {BANDS, Spectrum, bandPowers} from './spectrum.js';

/** @typedef {import('./spectrum.js').Result} Result */
/** @typedef {import('./traces.js').Traces} Traces */

/** Room at the left and at the bottom of the diagram, CSS pixels. */
const LEFT = 36, BOTTOM = 17;
/** Time between two spectra, and time for their computation in each frame of the screen, milliseconds. */
const PERIOD_MS = 1000, WORK_MS = 2;
/** Greek letters of the bands. */
const SYMBOLS = ['\u03b4', '\u03b8', '\u03b1', '\u03b2', '\u03b3'];
/** Largest frequency on a linear axis, Hz, and decades of a logarithmic axis of power. */
const MOST_HZ = 128, DECADES = 6;

export class SpectrumPanel {
  /** @param {Traces} traces */
  constructor(traces) {
    this.traces = traces;
    this.spectrum = new Spectrum();
    /** @type {HTMLCanvasElement} */
    this.canvas = find('density');
    /** @type {HTMLSelectElement} */
    this.frequency = find('frequency');
    /** @type {HTMLSelectElement} */
    this.power = find('power');
    /** @type {HTMLSelectElement} */
    this.which = find('which');
    /** @type {Result | null} */
    this.result = null;
    /** @type {number[]} channels of the result */
    this.channels = [];
    this.begun = -Infinity;
    this.wants = '';
    /** Chosen frequency, Hz. */
    this.hertz = 10;
    for (const select of [this.frequency, this.power, this.which]) select.addEventListener('change', () => this.show());
    this.canvas.addEventListener('mousemove', (event) => this.choose(this.at(event.offsetX * devicePixelRatio)));
    this.canvas.addEventListener('keydown', (event) => {
      const steps = Number(event.key === 'ArrowRight') - Number(event.key === 'ArrowLeft');
      if (steps === 0 || !this.result) return;
      event.preventDefault();
      this.choose(this.hertz + steps * this.result.step * (event.shiftKey ? 10 : 1));
    });
    new ResizeObserver(() => this.show()).observe(this.canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.show());
  }

  /** Computes a spectrum each second, and when what it shows has changed.
   * @param {number} now milliseconds */
  work(now) {
    const {traces} = this, [reference] = traces.references, {store, cursor, rows} = traces;
    if (!store || !reference || this.canvas.clientWidth === 0) return;
    const channels = this.which.value === 'all' ? rows : [cursor.channel];
    const wants = `${channels.join()} ${traces.held} ${traces.average}`;
    const isSame = reference.store === this.spectrum.reference?.store && wants === this.wants;
    if (isSame && now - this.begun < PERIOD_MS) return;
    this.spectrum.use(reference);
    const result = this.spectrum.work(traces.edge(), channels, performance.now() + WORK_MS);
    if (!result) return;
    this.wants = wants;
    this.begun = now;
    this.result = result;
    this.channels = channels;
    this.show();
  }

  /** @param {number} hertz moves the cursor to the nearest frequency */
  choose(hertz) {
    if (!this.result) return;
    const {bins, step} = this.result;
    this.hertz = Math.min(bins - 1, Math.max(1, Math.round(hertz / step))) * step;
    this.show();
  }

  /** Chosen channel, or the first one of the result. */
  channel() {
    const {channel} = this.traces.cursor;
    return this.channels.includes(channel) ? channel : this.channels[0] ?? 0;
  }

  show() {
    const {result, traces} = this, {store} = traces;
    if (!store || !result) return;
    const channel = this.channel(), label = store.labels[channel];
    const note = find('spectrum-note'), {length, used, leftOut, step, from, to} = result;
    const seconds = (length / store.rate).toFixed(2);
    note.textContent = used === 0 ? `no segment of ${seconds} s without fillers yet` :
      `${traces.stream?.name}${traces.average ? ', to the average' : ''}: ${used} segments of ${seconds} s, ` +
      `${(from / 1e6).toFixed(6)} to ${(to / 1e6).toFixed(6)} s; ${leftOut} with fillers left out`;
    if (used === 0) find('spectrum-cursor').textContent = 'no spectrum yet';
    else {
      const value = result.density[channel * result.bins + Math.round(this.hertz / step)];
      find('spectrum-cursor').textContent = `${label} ${value.toPrecision(5)} ${store.unit}\u00b2/Hz ` +
        `at ${this.hertz.toFixed(3)} Hz`;
    }
    const powers = bandPowers(result, channel), sum = powers.reduce((all, one) => all + (one || 0), 0);
    find('bands').replaceChildren(...BANDS.map(([name, low, high], k) => {
      const row = document.createElement('tr');
      const cells = [name, `${low} to ${high}`, used === 0 || Number.isNaN(powers[k]) ? '-' : powers[k].toPrecision(5),
        used === 0 || !(sum > 0) || Number.isNaN(powers[k]) ? '-' : `${(100 * powers[k] / sum).toFixed(0)} %`];
      row.append(...cells.map((text, at) => {
        const cell = document.createElement(at === 0 ? 'th' : 'td');
        if (at === 0) cell.setAttribute('scope', 'row');
        cell.textContent = text;
        return cell;
      }));
      return row;
    }));
    this.draw(result, channel);
  }

  /** Geometry in pixels of the screen, with the least and the greatest frequency. */
  geometry() {
    const ratio = devicePixelRatio, {width: all, height: whole} = this.canvas, left = Math.round(LEFT * ratio);
    const step = this.result?.step ?? 1, half = ((this.result?.bins ?? 2) - 1) * step;
    const isLog = this.frequency.value === 'log';
    const [low, high] = isLog ? [step, half] : [0, Math.min(half, MOST_HZ)];
    const [width, height] = [all - left - 4 * ratio, whole - (BOTTOM + 4) * ratio];
    return {ratio, left, top: 4 * ratio, width, height, isLog, low, high};
  }

  /** Pixel of a frequency.
   * @param {number} hertz */
  x(hertz) {
    const {left, width, isLog, low, high} = this.geometry();
    return left + width * (isLog ? Math.log(hertz / low) / Math.log(high / low) : (hertz - low) / (high - low));
  }

  /** Frequency of a pixel.
   * @param {number} x */
  at(x) {
    const {left, width, isLog, low, high} = this.geometry(), part = (x - left) / width;
    return isLog ? low * (high / low) ** part : low + part * (high - low);
  }

  /** @param {Result} result @param {number} channel */
  draw({density, bins, step, used}, channel) {
    const context = fit(this.canvas), {ratio, left, top, width, height, isLog, high} = this.geometry();
    context.fillStyle = colour('panel').css;
    context.fillRect(0, 0, this.canvas.width, this.canvas.height);
    context.font = `${10 * ratio}px "DejaVu Sans", sans-serif`;
    BANDS.forEach(([, from, to], k) => {
      if (to > high) return;
      context.fillStyle = colour(k % 2 === 0 ? 'ground' : 'panel').css;
      context.fillRect(this.x(from), top, this.x(to) - this.x(from), height);
      context.fillStyle = colour('faint').css;
      context.textAlign = 'center';
      context.textBaseline = 'top';
      context.fillText(SYMBOLS[k], this.x(Math.sqrt(from * to)), top + 2 * ratio);
    });
    const last = Math.min(bins - 1, Math.floor(high / step));
    let [least, most] = [Infinity, 0];
    for (const one of this.channels) {
      for (let n = 1; n <= last; n += 1) {
        const value = density[one * bins + n];
        if (value > 0) least = Math.min(least, value);
        most = Math.max(most, value);
      }
    }
    if (used > 0 && most > 0) {
      const y = this.scale(least, most);
      for (const one of [...this.channels.filter((other) => other !== channel), channel]) {
        context.strokeStyle = colour(one === channel ? 'chosen' : 'trace').css;
        context.globalAlpha = one === channel ? 1 : 0.4;
        context.lineWidth = (one === channel ? 1.5 : 1) * ratio;
        context.beginPath();
        for (let n = 1; n <= last; n += 1) {
          context.lineTo(this.x(n * step), Math.min(top + height, Math.max(top, y(density[one * bins + n]))));
        }
        context.stroke();
      }
      context.globalAlpha = 1;
    }
    context.fillStyle = colour('line').css;
    context.fillRect(left, top + height, width, 1);
    context.fillStyle = colour('faint').css;
    context.textBaseline = 'bottom';
    context.textAlign = 'center';
    for (const tick of isLog ? [1, 2, 5, 10, 20, 50, 100, 200] : [0, 10, 20, 30, 40, 50, 60, 80, 100, 120]) {
      const x = this.x(tick);
      if (tick > high || x > left + width - 6 * ratio) continue;
      context.fillRect(x, top + height, 1, 3 * ratio);
      context.fillText(tick === 0 ? '0 Hz' : String(tick), x, this.canvas.height);
    }
    context.fillStyle = colour('chosen').css;
    context.fillRect(this.x(Math.min(high, this.hertz)) - ratio, top + height, 3 * ratio, 6 * ratio);
  }

  /** Draws the axis of power. Returns the pixel of a value.
   * @param {number} least @param {number} most */
  scale(least, most) {
    const context = fit(this.canvas), {ratio, left, top, width, height} = this.geometry();
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    const isLog = this.power.value === 'log', end = isLog ? Math.ceil(Math.log10(most)) : nice(most);
    const begin = isLog ? Math.max(end - DECADES, Math.floor(Math.log10(least))) : 0;
    const ticks = isLog ? Array.from({length: end - begin + 1}, (_, k) => begin + k) :
      [0, 0.25, 0.5, 0.75, 1].map((part) => part * end);
    /** @param {number} place */
    const y = (place) => top + height * (1 - (place - begin) / Math.max(1e-12, end - begin));
    for (const tick of ticks) {
      context.fillStyle = colour('line').css;
      context.fillRect(left, Math.round(y(tick)), width, 1);
      context.fillStyle = colour('faint').css;
      const decade = tick < -2 || tick > 3 ? `1e${tick}` : String(Number((10 ** tick).toPrecision(1)));
      const text = isLog ? decade : String(Number(tick.toPrecision(3)));
      context.fillText(text, left - 3 * ratio, Math.max(top + 4 * ratio, y(tick)));
    }
    return /** @param {number} value */ (value) => y(isLog ? Math.log10(Math.max(value, 1e-30)) : value);
  }
}
