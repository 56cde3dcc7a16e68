// @ts-check
// Connects the bridge's messages with the panels, and the controls with what they change.

import {DIAGNOSTICS, DROPPED, ENCODED, FILTERED, RAW, RECONSTRUCTED, readFrame, readStatus, receive} from './feed.js';
import {Head} from './head.js';
import {Link} from './link.js';
import {Store} from './store.js';
import {Traces} from './traces.js';

/** @typedef {import('./feed.js').Message} Message */

/** Time before the first new attempt to reach a lost bridge, and the longest one, milliseconds. */
const RETRY_MS = 500, MAX_RETRY_MS = 4000;
/** Streams of signals with their names. */
const STREAMS = new Map([[RECONSTRUCTED, 'reconstructed'], [FILTERED, 'filtered'], [RAW, 'raw']]);
/** Microvolts per row, and seconds of the time axis. */
const SCALES = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 5000, 20000, 50000], TIMES = [1, 2, 5, 10, 20, 30];

/** @template {Element} [T=HTMLElement] @param {string} id @returns {T} */
const find = (id) => /** @type {T} */ (/** @type {unknown} */ (document.getElementById(id)));
const state = find('state'), pause = find('pause');
/** @type {HTMLSelectElement} */
const stream = find('stream');
/** @type {HTMLSelectElement} */
const scale = find('scale');
/** @type {HTMLSelectElement} */
const time = find('time');
/** @type {HTMLInputElement} */
const shown = find('shown');
/** @type {HTMLFormElement} */
const access = find('access');
/** @type {HTMLInputElement} */
const tokenField = find('token');
/** @type {HTMLCanvasElement} */
const plot = find('plot');

/** @type {Map<number, Store>} */
const stores = new Map();
const link = new Link(document);
const traces = new Traces(plot, (text) => {
  find('cursor').textContent = text;
  head.choose(traces.store?.labels[traces.cursor.channel] ?? '');
});
const head = new Head(find('head'), find('quality'), (label) => {
  const channel = traces.store ? traces.store.labels.indexOf(label) : -1;
  if (channel >= 0 && traces.rows.includes(channel)) traces.place(traces.cursor.index, channel);
});

// The token comes in the fragment of the address, which a browser sends nowhere. It is kept for
// reloads of this tab, and removed from the address.
const given = new URLSearchParams(location.hash.slice(1)).get('token');
if (given !== null) {
  sessionStorage.setItem('token', given);
  history.replaceState(null, '', '/');
}
let token = sessionStorage.getItem('token') ?? '';

/** @param {number} level @param {string} text */
function setState(level, text) {
  state.dataset.level = String(level);
  if (state.textContent !== text) state.textContent = text;
}

/** @param {Message} message */
function onMessage({topic, publishedUs, body}) {
  if (topic === DROPPED) {
    link.dropped += body.u64();
    link.restart();
  }
  else if (topic === ENCODED) link.code(publishedUs);
  else if (topic === DIAGNOSTICS) {
    const statuses = readStatus(body);
    head.report(statuses);
    link.report(statuses, traces.store?.fillers ?? 0);
    if ([...head.substituted].join() !== [...traces.substituted].join()) {
      traces.substituted = head.substituted;
      traces.invalidate();
    }
    const device = statuses.find((status) => status.name === 'device');
    if (device) setState(device.level, device.message);
  } else if (STREAMS.has(topic)) {
    const frame = readFrame(body);
    let store = stores.get(topic);
    if (!store || !store.fits(frame)) {
      store = new Store(frame);
      stores.set(topic, store);
      offerStreams();
    }
    store.append(frame);
  }
}

/** Offers the streams that were received, and shows the chosen one. */
function offerStreams() {
  const chosen = Number(stream.value);
  const topics = [...STREAMS.keys()].filter((topic) => stores.has(topic));
  stream.replaceChildren(...topics.map((topic) => new Option(STREAMS.get(topic), String(topic))));
  stream.value = String(topics.includes(chosen) ? chosen : topics[0]);
  show();
}

function show() {
  const store = stores.get(Number(stream.value)) ?? null;
  const changed = store !== traces.store;
  traces.measured = Number(stream.value) !== RECONSTRUCTED;
  traces.show(store, shown.value.split(/[\s,]+/).filter((label) => label));
  if (changed) {
    setPaused(false);
    find('cursor').textContent = traces.words();
  }
  if (store) head.show(store.labels.slice(0, store.electrodes)).catch(() => {});
}

/** @param {boolean} paused */
function setPaused(paused) {
  traces.pause(paused);
  pause.setAttribute('aria-pressed', String(paused));
}

/** @param {HTMLSelectElement} select @param {number} steps */
function change(select, steps) {
  const index = Math.min(select.options.length - 1, Math.max(0, select.selectedIndex + steps));
  if (index === select.selectedIndex) return;
  select.selectedIndex = index;
  select.dispatchEvent(new Event('change'));
}

/** @param {string} command */
async function send(command) {
  const headers = {Authorization: `Bearer ${token}`};
  const response = await fetch(`/${command}`, {method: 'POST', headers}).catch(() => null);
  if (!response?.ok) setState(2, `${command} is refused: ${response?.status ?? 'no answer'}`);
}

scale.append(...SCALES.map((uv) => new Option(uv < 1000 ? `${uv} uV` : `${uv / 1000} mV`, String(uv))));
time.append(...TIMES.map((seconds) => new Option(`${seconds} s`, String(seconds))));
scale.value = String(traces.microvolts);
time.value = String(traces.seconds);
scale.addEventListener('change', () => {
  traces.microvolts = Number(scale.value);
  traces.invalidate();
});
time.addEventListener('change', () => {
  traces.seconds = Number(time.value);
  traces.invalidate();
});
stream.addEventListener('change', show);
shown.addEventListener('change', show);
pause.addEventListener('click', () => setPaused(traces.held === null));
find('controls').addEventListener('submit', (event) => event.preventDefault());
find('start').addEventListener('click', () => send('start'));
find('stop').addEventListener('click', () => send('stop'));

/** What a key of the plot does. @type {Record<string, (shift: boolean) => void>} */
const KEYS = {
  ArrowLeft: (shift) => traces.move(shift ? -(traces.store?.rate ?? 0) : -1, 0),
  ArrowRight: (shift) => traces.move(shift ? traces.store?.rate ?? 0 : 1, 0),
  ArrowUp: () => traces.move(0, -1),
  ArrowDown: () => traces.move(0, 1),
  ' ': () => setPaused(traces.held === null),
  PageUp: () => scroll(-1),
  PageDown: () => scroll(1),
  '+': () => change(scale, -1),
  '-': () => change(scale, 1),
  '[': () => change(time, -1),
  ']': () => change(time, 1),
};

/** Scrolls by half the time axis. @param {number} direction */
function scroll(direction) {
  traces.scroll(direction * traces.seconds / 2);
  pause.setAttribute('aria-pressed', String(traces.held !== null));
}

plot.addEventListener('keydown', (event) => {
  const act = KEYS[event.key];
  if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  act(event.shiftKey);
});

/** Draws at the screen's rate, while the page is visible. @param {number} now */
function frame(now) {
  traces.draw(now);
  document.body.dataset.drawn = `${traces.cost.count} ${(traces.cost.sum / Math.max(1, traces.cost.count)).toFixed(2)} ` +
    traces.cost.longest.toFixed(2);
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);

/** @type {() => void} */
let retry = () => {};
access.addEventListener('submit', (event) => {
  event.preventDefault();
  token = tokenField.value;
  sessionStorage.setItem('token', token);
  retry();
});

/** Receives messages, again and again. */
async function run() {
  let wait = RETRY_MS, wasRight = false;
  for (;;) {
    const onOpen = () => {
      wait = RETRY_MS;
      wasRight = token !== '';
      access.hidden = true;
      find('commands').hidden = token === '';
      link.clear();
      head.clear();
      setState(3, 'connected');
    };
    const status = await receive(token, onOpen, onMessage);
    if (status === 401 && wasRight) {
      // The bridge has started again, with a new token. On loopback it lets the page look without one.
      wasRight = false;
      token = '';
      sessionStorage.removeItem('token');
      continue;
    }
    if (status === 401) {
      setState(2, 'the token is missing or wrong');
      access.hidden = false;
      find('commands').hidden = true;
      await new Promise((resolve) => { retry = () => resolve(undefined); });
      continue;
    }
    setState(2, status === 503 ? 'too many pages are open' : 'the bridge is lost; trying again');
    await new Promise((resolve) => { setTimeout(resolve, wait); });
    wait = Math.min(2 * wait, MAX_RETRY_MS);
  }
}
run();
