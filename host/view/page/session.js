// @ts-check
// Records, marks moments, tests the converters, excludes electrodes, and shows the device's state.

import {find} from './element.js';

/** @typedef {import('./feed.js').Status} Status */
/** @typedef {import('./feed.js').DeviceEvent} DeviceEvent */
/**
 * @typedef {{channel: number, label: string, gain_error_percent: number | null, offset_uv: number | null,
 *   noise_uv: number | null, shorted_noise_uv: number | null, verdict: string, in_order: boolean}} Channel
 * @typedef {{channels: Channel[], verdict: string, passed: boolean,
 *   chips: {chip: number, part: string, in_order: boolean}[]}} Report
 * @typedef {{message: string, report?: Report, published?: boolean, text?: string}} Reply
 */

/** Code of a marker, as in `NeuroEvent::MARKER`. */
const MARKER = 0x7f05;
/** Most markers in the list. */
const MOST = 50;
/** Words of what is missing without the token. */
const NEEDS = 'Commands need the token: open the address that the bridge has printed, or type the token.';

/** @param {number} bytes */
function size(bytes) {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let unit = 0;
  for (; bytes >= 1000 && unit < units.length - 1; unit += 1) bytes /= 1000;
  return `${bytes.toFixed(unit === 0 || bytes >= 100 ? 0 : 1)} ${units[unit]}`;
}

/** @param {number} seconds */
function clock(seconds) {
  const two = (/** @type {number} */ number) => String(Math.floor(number)).padStart(2, '0');
  return `${two(seconds / 3600)}:${two(seconds / 60 % 60)}:${two(seconds % 60)}`;
}

/** @param {string} word @returns {string} the word as a shell takes it */
function quoted(word) {
  return /^[\w./-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

/** @param {string} name @param {string} text @param {string} [className] */
function element(name, text, className = '') {
  const node = document.createElement(name);
  node.textContent = text;
  node.className = className;
  return node;
}

export class Session {
  /** @param {() => string} token */
  constructor(token) {
    this.token = token;
    /** @type {HTMLFieldSetElement[]} */
    this.controls = [find('session-controls'), find('device-controls')];
    this.record = find('record');
    /** @type {HTMLInputElement} */
    this.text = find('marker-text');
    /** @type {HTMLSelectElement} */
    this.electrode = find('electrode');
    /** @type {HTMLSelectElement} */
    this.rate = find('rate');
    this.isRecording = false;
    /** Path of the newest recording. */
    this.file = 'RECORDING.wire';
    this.mains = '50';
    this.presentRate = '';
    /** @type {Map<string, Status>} */
    this.statuses = new Map();
    this.rate.append(...Array.from({length: 16}, (_, rate) => new Option(String(rate))));
    this.record.addEventListener('click', () => this.send('record', this.isRecording ? 'stop' : 'start'));
    find('marker').addEventListener('submit', (event) => {
      event.preventDefault();
      this.mark();
    });
    find('self-test').addEventListener('click', () => this.test());
    for (const decision of ['always', 'never', 'automatic']) {
      const decide = () => this.send('exclude', `${this.electrode.value} ${decision}`);
      find(`exclude-${decision}`).addEventListener('click', decide);
    }
    find('set-rate').addEventListener('click', () => this.send('rate', this.rate.value));
    this.allow();
    this.showCommands();
  }

  /** Shows whether commands can be sent. */
  allow() {
    const allowed = this.token() !== '';
    for (const controls of this.controls) controls.disabled = !allowed;
    find('needs').textContent = allowed ? '' : NEEDS;
  }

  /** Asks the bridge whether a token is right, and says why if it does not accept it.
   * @param {string} token @returns {Promise<boolean>} */
  async check(token) {
    const abort = new AbortController();
    const headers = {Authorization: `Bearer ${token}`};
    const response = await fetch('/stream', {headers, signal: abort.signal}).catch(() => null);
    abort.abort();
    if (response?.ok) return true;
    const reasons = new Map([
      [401, 'This token is wrong. The bridge has printed the right one.'],
      [503, 'Too many pages are open; close one and try again.'],
    ]);
    find('needs').textContent = reasons.get(response?.status ?? 0) ?? 'The bridge does not answer.';
    return false;
  }

  /** Forgets the reports of a bridge that was lost. */
  clear() {
    this.statuses.clear();
    this.allow();
    this.show();
  }

  /** Shows the electrodes that can be excluded.
   * @param {string[]} labels */
  offer(labels) {
    if ([...this.electrode.options].map((option) => option.value).join() === labels.join()) return;
    const chosen = this.electrode.value;
    this.electrode.replaceChildren(...labels.map((label) => new Option(label)));
    if (labels.includes(chosen)) this.electrode.value = chosen;
  }

  /** Sends a command. Returns the reply, or nothing if the command is refused.
   * @param {string} command @param {string} [body] @returns {Promise<Reply | null>} */
  async send(command, body = '') {
    const request = {method: 'POST', headers: {Authorization: `Bearer ${this.token()}`}, body};
    try {
      const response = await fetch(`/${command}`, request);
      const isWrong = response.status === 401;
      if (isWrong) find('access').hidden = false;
      if (!response.ok) {
        const why = isWrong ? 'the token is wrong' : await response.text();
        return this.say(command, `${command} is refused: ${why}`, true);
      }
      /** @type {Reply} */
      const reply = await response.json();
      this.say(command, reply.message, false);
      return reply;
    } catch {
      return this.say(command, 'the bridge does not answer', true);
    }
  }

  /** Shows the answer to a command in its panel.
   * @param {string} command @param {string} text @param {boolean} isError @returns {null} */
  say(command, text, isError) {
    const ofDevice = ['exclude', 'rate', 'self-test'].includes(command);
    const answer = find(ofDevice ? 'device-answer' : 'answer');
    answer.textContent = text;
    answer.className = isError ? 'level2' : '';
    return null;
  }

  async mark() {
    const text = this.text.value;
    // The field is empty at once, so that a second Enter marks nothing.
    this.text.value = '';
    const reply = await this.send('marker', text);
    if (!reply) {
      if (this.text.value === '') this.text.value = text;
      return;
    }
    // A marker that is published comes back as an event.
    if (!reply.published) this.list(reply.text ?? '');
  }

  /** Notes an event.
   * @param {DeviceEvent} event */
  event(event) {
    if (event.code === MARKER) this.list(event.description);
  }

  /** @param {string} text */
  list(text) {
    const item = element('li', '');
    item.append(element('time', new Date().toTimeString().slice(0, 8)), element('span', text));
    const list = find('markers');
    list.prepend(item);
    while (list.children.length > MOST) list.lastChild?.remove();
  }

  async test() {
    this.say('self-test', 'the device tests its converters', false);
    const reply = await this.send('self-test');
    if (reply?.report) this.table(reply.report);
  }

  /** Shows the result of a self-test.
   * @param {Report} report */
  table(report) {
    find('tested').hidden = false;
    const verdict = find('verdict'), chips = report.chips.filter((chip) => !chip.in_order);
    const named = chips.map((chip) => `chip ${chip.chip} (${chip.part})`).join(', ');
    verdict.textContent = named ? `${report.verdict}: ${named}` : report.verdict;
    verdict.className = report.passed ? 'level0' : 'level2';
    /** @param {number | null} number @param {number} digits */
    const figure = (number, digits) => number === null ? '-' : number.toFixed(digits);
    find('channels').replaceChildren(...report.channels.map((channel) => {
      const row = document.createElement('tr'), label = element('th', channel.label);
      label.setAttribute('scope', 'row');
      row.append(
        label,
        element('td', figure(channel.gain_error_percent, 2)),
        element('td', figure(channel.offset_uv, 1)),
        element('td', figure(channel.noise_uv, 2)),
        element('td', figure(channel.shorted_noise_uv, 2)),
        element('td', channel.verdict, channel.in_order ? 'level0' : 'level2'),
      );
      return row;
    }));
  }

  /** @param {Status[]} statuses */
  report(statuses) {
    for (const status of statuses) this.statuses.set(status.name, status);
    this.show();
  }

  show() {
    /** @param {string} name @param {string} key */
    const value = (name, key) => this.statuses.get(name)?.values.get(key);
    const recording = this.statuses.get('recording');
    const seconds = value('recording', 'seconds'), left = value('recording', 'disk left bytes');
    const wasRecording = this.isRecording;
    this.isRecording = seconds !== undefined;
    if (wasRecording && !this.isRecording && recording && recording.level > 0) {
      this.say('record', recording.message, recording.level > 1);
    }
    this.record.textContent = this.isRecording ? 'Stop recording' : 'Record';
    this.record.classList.toggle('recording', this.isRecording);
    const state = find('recording');
    state.className = `level${recording && recording.level > 0 ? recording.level : 'none'}`;
    const words = this.isRecording
      ? [clock(Number(seconds)), size(Number(value('recording', 'bytes')))]
      : [recording?.message ?? 'no report yet'];
    const lost = Number(value('recording', 'bytes lost') ?? 0);
    if (lost > 0) words.push(`${size(lost)} lost, the disk is too slow`);
    state.textContent = words.join(' \u00b7 ');
    const file = value('recording', 'file');
    const folder = value('recording', 'folder') ?? '.';
    const disk = left === undefined ? '' : `${size(Number(left))} left in ${folder}`;
    find('left').textContent = file === undefined ? disk : `${file} \u00b7 ${disk}`;
    const mains = value('device', 'mains Hz') ?? this.mains;
    const path = folder === '.' ? file : file && `${folder.replace(/\/+$/, '')}/${file}`;
    if ((path ?? this.file) !== this.file || mains !== this.mains) {
      this.file = path ?? this.file;
      this.mains = mains;
      this.showCommands();
    }
    const rate = value('packed code', 'rate');
    find('rates').hidden = rate === undefined;
    if (rate !== undefined && rate !== this.presentRate) this.rate.value = this.presentRate = rate;
    find('present-rate').textContent = rate === undefined ? '' : `now ${rate}`;
    const device = this.statuses.get('device');
    find('device').textContent = device
      ? `session ${value('device', 'session') ?? '-'} \u00b7 ${value('device', 'resets') ?? 0} restarts \u00b7 ` +
        `fault: ${value('device', 'fault') || value('converters', 'fault') || 'none'}`
      : 'no report yet';
  }

  /** Shows how a model is fitted to the person whose EEG was recorded. */
  showCommands() {
    const raw = this.file.replace(/\.wire$/, '.raw.gdf');
    find('calibrate').textContent = `corticode-bridge convert ${quoted(this.file)} --to gdf\n` +
      `corticode-bridge calibrate --subject NAME --mains ${this.mains} \\\n  --recording ${quoted(raw)}`;
  }
}
