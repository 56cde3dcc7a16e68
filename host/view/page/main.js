// @ts-check
// Connects the bridge's messages with the panels, and the controls with what they change.

import {CodePanel} from './code.js';
import {find} from './element.js';
import {Events} from './events.js';
import {
  DIAGNOSTICS, DROPPED, ENCODED, EVENTS, FILTERED, RAW, RECONSTRUCTED, readFrame, readStatus, receive,
} from './feed.js';
import {Head} from './head.js';
import {History, mostBytes} from './history.js';
import {Link} from './link.js';
import {Session} from './session.js';
import {SpectrumPanel} from './spectrum_panel.js';
import {Store} from './store.js';
import {Traces} from './traces.js';

/** @typedef {import('./feed.js').Message} Message */

/** Time before the first new attempt to reach a lost bridge, and the longest one, milliseconds. */
const RETRY_MS = 500, MAX_RETRY_MS = 4000;
/** Streams of signals with their names. */
const STREAMS = new Map([[RECONSTRUCTED, 'reconstructed'], [FILTERED, 'filtered'], [RAW, 'raw']]);
/** Microvolts per row, and seconds of the time axis. */
const SCALES = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 5000, 20000, 50000], TIMES = [1, 2, 5, 10, 20, 30];

const state = find('state'), pause = find('pause');
/** @type {HTMLSelectElement} */
const stream = find('stream');
/** @type {HTMLSelectElement} */
const over = find('over');
/** @type {HTMLSelectElement} */
const reference = find('reference');
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
const link = new Link(), events = new Events(), code = new CodePanel();
const traces = new Traces(plot, (text) => {
  find('cursor').textContent = text;
  head.choose(traces.store?.labels[traces.cursor.channel] ?? '');
}, events);
const spectrum = new SpectrumPanel(traces);
const past = new History(traces, showPaused);
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
const session = new Session(() => token);

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
  } else if (topic === ENCODED) {
    link.code(publishedUs);
    code.code(readFrame(body));
  } else if (topic === EVENTS) {
    // An event mostly comes before its sample. Otherwise its column is already drawn.
    const event = events.add(body);
    if (event.time <= traces.edge()) traces.plot.invalidate();
    session.event(event);
  } else if (topic === DIAGNOSTICS) {
    const statuses = readStatus(body);
    head.report(statuses);
    code.report(statuses, performance.now());
    session.report(statuses);
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
      store = new Store(frame, mostBytes());
      stores.set(topic, store);
      offerStreams();
    }
    const restarts = store.restarts;
    store.append(frame);
    if (store.restarts > restarts && topic === Number(stream.value)) events.restart();
  }
}

/** Offers the streams that were received, and shows the chosen ones. */
function offerStreams() {
  const topics = [...STREAMS.keys()].filter((topic) => stores.has(topic));
  for (const [select, first] of /** @type {[HTMLSelectElement, string[]][]} */ ([[stream, []], [over, ['0']]])) {
    const chosen = select.value, options = [...first, ...topics.map(String)];
    select.replaceChildren(...options.map((topic) => new Option(STREAMS.get(Number(topic)) ?? 'none', topic)));
    select.value = options.includes(chosen) ? chosen : options[0];
  }
  show();
}

/** @param {HTMLSelectElement} select @returns {import('./traces.js').Stream | null} the chosen stream */
function chosen(select) {
  const topic = Number(select.value), store = stores.get(topic);
  return store ? {store, name: STREAMS.get(topic) ?? '', measured: topic !== RECONSTRUCTED} : null;
}

function show() {
  if (over.value === stream.value) over.value = '0';
  const before = traces.store, first = chosen(stream), second = chosen(over);
  traces.average = reference.value === 'average';
  traces.show(first, second, shown.value.split(/[\s,]+/).filter((label) => label));
  find('first-name').textContent = (first?.name ?? 'stream') + (traces.average ? ', to the average' : '');
  find('second-legend').hidden = second === null;
  find('second-name').textContent = second?.name ?? '';
  for (const option of over.options) option.disabled = option.value === stream.value;
  if (first?.store !== before) setPaused(false);
  find('cursor').textContent = traces.words();
  if (first) session.offer(first.store.labels.slice(0, first.store.electrodes));
  showHead();
}

/** Shows the electrodes of the chosen stream; if the bridge does not answer, again when it is reached. */
function showHead() {
  const store = traces.store;
  if (!store) return;
  const choose = () => head.choose(store.labels[traces.cursor.channel] ?? '');
  head.show(store.labels.slice(0, store.electrodes)).then(choose, () => {});
}

/** @param {boolean} paused */
function setPaused(paused) {
  traces.pause(paused);
  showPaused();
}

function showPaused() { pause.setAttribute('aria-pressed', String(traces.held !== null)); }

/** @param {HTMLSelectElement} select @param {number} steps */
function change(select, steps) {
  const index = Math.min(select.options.length - 1, Math.max(0, select.selectedIndex + steps));
  if (index === select.selectedIndex) return;
  select.selectedIndex = index;
  select.dispatchEvent(new Event('change'));
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
for (const select of [stream, over, reference]) select.addEventListener('change', show);
shown.addEventListener('change', show);
pause.addEventListener('click', () => setPaused(traces.held === null));
find('controls').addEventListener('submit', (event) => event.preventDefault());
find('start').addEventListener('click', () => session.send('start'));
find('stop').addEventListener('click', () => session.send('stop'));

/** What a key of the plot does.
 * @type {Record<string, (shift: boolean) => void>} */
const KEYS = {
  ArrowLeft: (shift) => traces.move(shift ? -(traces.store?.rate ?? 0) : -1, 0),
  ArrowRight: (shift) => traces.move(shift ? traces.store?.rate ?? 0 : 1, 0),
  ArrowUp: () => traces.move(0, -1),
  ArrowDown: () => traces.move(0, 1),
  ' ': () => setPaused(traces.held === null),
  PageUp: () => scroll(-1),
  PageDown: () => scroll(1),
  Home: () => hold(traces.store?.begun() ?? 0),
  End: () => setPaused(false),
  n: () => toEvent(1),
  p: () => toEvent(-1),
  a: () => {
    reference.value = traces.average ? 'none' : 'average';
    show();
  },
  '+': () => change(scale, -1),
  '-': () => change(scale, 1),
  '[': () => change(time, -1),
  ']': () => change(time, 1),
};

/** Scrolls by half the time axis.
 * @param {number} direction */
function scroll(direction) {
  traces.scroll(direction * traces.seconds / 2);
  showPaused();
}

/** @param {number} direction */
function toEvent(direction) {
  traces.toEvent(direction);
  showPaused();
}

/** Shows the history from a device time on.
 * @param {number} time */
function hold(time) {
  traces.hold(time + traces.seconds * 1e6);
  showPaused();
}

plot.addEventListener('wheel', (event) => {
  if (event.ctrlKey) return;
  event.preventDefault();
  scroll(Math.sign(event.deltaX || event.deltaY) / 5);
}, {passive: false});

plot.addEventListener('keydown', (event) => {
  const act = KEYS[event.key] ?? KEYS[event.key.toLowerCase()];
  if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  act(event.shiftKey);
});

let reported = 0;

/** Draws at the screen's rate, while the page is visible.
 * @param {number} now */
function frame(now) {
  traces.plot.draw(now);
  spectrum.work(now);
  code.draw();
  past.update();
  if (now - reported > 1000) {
    reported = now;
    const {count, median, late, longest} = traces.plot.cost();
    document.body.dataset.drawn = `${count} ${median.toFixed(2)} ${late.toFixed(2)} ${longest.toFixed(2)}`;
  }
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);

/** @type {() => void} */
let retry = () => {};
/** Whether messages arrive, and whether the bridge has accepted the token. */
let isOpen = false, wasRight = false;
access.addEventListener('submit', async (event) => {
  event.preventDefault();
  const typed = tokenField.value;
  // A page that looks without a token goes on in the same traces.
  if (isOpen && !await session.check(typed)) return;
  token = typed;
  sessionStorage.setItem('token', token);
  if (isOpen) showAccess();
  else retry();
});

/** Shows what the user can do with the token that the bridge has accepted, or without one. */
function showAccess() {
  wasRight = token !== '';
  access.hidden = token !== '';
  find('commands').hidden = token === '';
  session.allow();
}

/** Receives messages, again and again. */
async function run() {
  let wait = RETRY_MS;
  for (;;) {
    const onOpen = () => {
      wait = RETRY_MS;
      isOpen = true;
      showAccess();
      link.clear();
      code.clear();
      head.clear();
      session.clear();
      showHead();
      setState(3, 'connected');
    };
    const status = await receive(token, onOpen, onMessage);
    isOpen = false;
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
      session.allow();
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
