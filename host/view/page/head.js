// @ts-check
// Shows the electrodes at their places, with what the device reports of each.

/** @typedef {import('./feed.js').Status} Status */

const SVG = 'http://www.w3.org/2000/svg';
/** Radius of an electrode; that of the head is 1. */
const RADIUS = 0.085;
/** Impedance from which a contact is fair, and bad, kilohms, as in docs/bridge.md. */
const FAIR_KOHM = 5, BAD_KOHM = 20;
/** Reports after which an impedance that they lack is old: it is measured about every second, and no longer
 * once another stream takes its place. */
const MOST_AGE = 3;
/** Mains voltage above which an electrode is bad, microvolts, as in docs/bridge.md. */
const MAINS_UV = 100;

/** @param {string} name @param {Record<string, string | number>} attributes */
function element(name, attributes) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, String(value));
  return node;
}

export class Head {
  /** @param {SVGElement} svg @param {HTMLElement} summary @param {(label: string) => void} onChoose */
  constructor(svg, summary, onChoose) {
    this.svg = svg;
    this.summary = summary;
    this.onChoose = onChoose;
    /** @type {Map<string, SVGElement>} */
    this.circles = new Map();
    /** @type {string[]} */
    this.labels = [];
    /** @type {Map<string, string>} */
    this.quality = new Map();
    /** @type {Map<string, string>} */
    this.impedance = new Map();
    /** Reports since the one with the impedance. */
    this.age = 0;
    /** @type {Set<string>} */
    this.off = new Set();
    /** @type {Set<string>} */
    this.substituted = new Set();
  }

  /** Forgets the reports of a bridge that was lost. */
  clear() {
    this.quality = new Map();
    this.impedance = new Map();
    this.off = new Set();
    this.substituted = new Set();
    this.summary.textContent = 'no report yet';
    this.update();
  }

  /** @param {string[]} labels */
  async show(labels) {
    if (labels.join() === this.labels.join()) return;
    this.labels = labels;
    this.circles.clear();
    this.svg.replaceChildren(
      element('circle', {r: 1, class: 'outline'}),
      element('path', {d: 'M-0.12 -0.99L0 -1.12L0.12 -0.99', class: 'outline'}),
    );
    /** @type {([number, number] | null)[]} */
    let places;
    try {
      const response = await fetch(`/places?${labels.map(encodeURIComponent).join(',')}`);
      places = await response.json();
    } catch (error) {
      // The next call asks again.
      if (this.labels === labels) this.labels = [];
      throw error;
    }
    labels.forEach((label, index) => {
      const place = places[index];
      if (!place) return;
      const [x, y] = [place[0], -place[1]];
      const circle = element('circle', {cx: x, cy: y, r: RADIUS, class: 'electrode', role: 'img'});
      circle.append(element('title', {}));
      circle.addEventListener('click', () => this.onChoose(label));
      const text = element('text', {x, y: y + 0.03, 'aria-hidden': 'true'});
      text.textContent = label;
      this.svg.append(circle, text);
      this.circles.set(label, circle);
    });
    this.update();
  }

  /** @param {Status[]} statuses */
  report(statuses) {
    this.age += 1;
    if (this.age > MOST_AGE) this.impedance = new Map();
    for (const {name, values, message} of statuses) {
      if (name === 'signal quality') {
        this.quality = values;
        this.summary.textContent = message;
      } else if (name === 'impedance') {
        this.impedance = values;
        this.age = 0;
      } else if (name === 'exclusion') this.substituted = labelsOf(values.get('excluded'));
      else if (name === 'converters') {
        const off = ['positive electrodes off', 'negative electrodes off'].map((key) => labelsOf(values.get(key)));
        this.off = new Set(off.flatMap((set) => [...set]));
      }
    }
    this.update();
  }

  /** @param {string} label */
  choose(label) {
    for (const [one, circle] of this.circles) circle.classList.toggle('chosen', one === label);
  }

  update() {
    for (const [label, circle] of this.circles) {
      const quality = this.quality.get(label), impedance = this.impedance.get(label);
      const filled = this.substituted.has(label), off = this.off.has(label);
      const state = stateOf(quality, impedance, off);
      const words = [label, off ? 'off' : '', impedance ?? '', quality ?? '', filled ? 'filled from the others' : ''];
      const text = words.filter((word) => word).join('; ');
      for (const one of ['good', 'fair', 'bad']) circle.classList.toggle(one, one === state);
      circle.classList.toggle('substituted', filled);
      circle.setAttribute('aria-label', text);
      const title = circle.firstElementChild;
      if (title && title.textContent !== text) title.textContent = text;
    }
  }
}

/** @param {string | undefined} text @returns {Set<string>} */
function labelsOf(text) {
  return new Set(text && text !== 'none' ? text.split(' ') : []);
}

/** @param {string | undefined} quality @param {string | undefined} impedance @param {boolean} off */
function stateOf(quality, impedance, off) {
  const mains = Number(/mains ([\d.]+) uV/.exec(quality ?? '')?.[1] ?? 0);
  if (off || impedance === 'open' || /flat|rail/.test(quality ?? '') || mains > MAINS_UV) return 'bad';
  const kohm = Number(/([\d.]+) kOhm/.exec(impedance ?? '')?.[1] ?? 0);
  if (kohm >= BAD_KOHM) return 'bad';
  if (kohm >= FAIR_KOHM) return 'fair';
  return quality || impedance ? 'good' : '';
}
