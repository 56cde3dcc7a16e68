// Lets a device restart, and returns what remains of the samples and events of its first run: nothing, though an
// event of the second run came before its samples.
return Promise.all([import('/store.js'), import('/events.js'), import('/feed.js')]).then(([{Store}, {Events}, {Reader}]) => {
  const bytes = (us, code, text) => {
    const view = new DataView(new ArrayBuffer(64 + text.length)), frame = 'device', encoder = new TextEncoder();
    let at = 4;
    const u32 = (value) => { view.setUint32(at, value, true); at += 4; };
    const write = (words) => {
      u32(words.length);
      new Uint8Array(view.buffer).set(encoder.encode(words), at);
      at += words.length;
    };
    u32(Math.floor(us / 1e6));
    u32(us % 1e6 * 1000);
    write(frame);
    u32(1);
    write('1');
    for (const value of [code, 0, 0]) u32(value);
    write(text);
    return new Reader(new Uint8Array(view.buffer));
  };
  const info = {nsamples: 1, nchannels: 1, unit: 'uV', transducer: '', labels: ['Cz']};
  const none = {...info, nchannels: 0, labels: []};
  const frame = (us) => ({seq: 0, rate: 128, eeg: info, eegData: Float32Array.of(us), exg: none, exgData: new Float32Array(0),
    tri: Int32Array.of(0, 0, 0, us % 65536, Math.floor(us / 65536), 0, 0, 0)});
  const store = new Store(frame(0), 2 ** 26), events = new Events(), faults = [];
  for (let i = 0; i < 5000; i += 1) store.append(frame(60e6 + Math.round(i * 7812.5)));
  events.add(bytes(80e6, 0x8001, 'trigger low'));
  events.add(bytes(79000002, 1, 'trigger high'));
  if (events.all.map((event) => event.time).join() !== '79000002,80000000') faults.push('events are not in order');
  if (store.time(Events.sample(events.all[0], store, false)) !== 79007813) faults.push('an event is at a sample before it');
  events.add(bytes(100000, 1, 'trigger high'));
  store.append(frame(7813));
  if (store.restarts !== 1) faults.push('no restart');
  events.restart();
  store.append(frame(15625));
  if (store.next - store.first !== 2 || store.value(store.first, 0) !== 7813) faults.push('samples of the first run');
  if (events.all.map((event) => event.time).join() !== '100000') faults.push('events of the first run');
  return faults;
});
