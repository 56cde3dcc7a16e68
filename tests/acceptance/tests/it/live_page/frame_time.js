// Draws a stream that grows by the samples of a sixtieth of a second before each drawing, for ten seconds, and
// returns median, 99th percentile and longest time of a drawing with its pixels, and the least median of a
// second, in milliseconds.
const FRAMES = 600;
const cases = [
  ['61 traces at 128 Hz', 61, 128, false], ['61 traces at 128 Hz, two streams', 61, 128, true],
  ['64 traces at 512 Hz', 64, 512, false], ['64 traces at 512 Hz, two streams', 64, 512, true],
];
return Promise.all([import('/store.js'), import('/traces.js')]).then(async ([{Store}, {Traces}]) => {
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; width: 930px; height: 600px; left: 0; top: 0';
  document.body.append(canvas);
  await new Promise((done) => setTimeout(done, 200));
  const results = cases.map(([name, channels, rate, both]) => {
    const labels = Array.from({length: channels}, (_, channel) => `E${channel}`);
    const info = {nsamples: 1, nchannels: channels, unit: 'uV', transducer: '', labels};
    const none = {...info, nchannels: 0, labels: []};
    const frame = (i) => {
      const us = Math.round(i * 1e6 / rate), tri = Int32Array.of(0, 0, 0, us % 65536, Math.floor(us / 65536), 0, 0, 0);
      const eegData = Float32Array.from(labels, (_, c) => 30 * Math.sin(62.8 * i / rate + c) + 20 * Math.sin(i * i + c));
      return {seq: i, rate, eeg: info, eegData, exg: none, exgData: new Float32Array(0), tri};
    };
    const stores = [new Store(frame(0), 2 ** 28), new Store(frame(0), 2 ** 28)];
    let next = 0;
    const feed = (end) => {
      for (; next < end; next += 1) for (const store of stores) store.append(frame(next));
    };
    feed(15 * rate);
    const [stream, second] = stores.map((store, k) => ({store, name: String(k), measured: true}));
    const traces = new Traces(canvas, () => {});
    traces.show(stream, both ? second : null, []);
    const took = [], now = performance.now();
    for (let k = 0; k < FRAMES; k += 1) {
      feed(15 * rate + Math.floor(k * rate / 60));
      const begun = performance.now();
      traces.plot.draw(now + k * 1000 / 60);
      // The browser draws when the pixels are read at the latest.
      traces.plot.context.getImageData(0, 0, 1, 1);
      took.push(performance.now() - begun);
    }
    const seconds = Array.from({length: FRAMES / 60}, (_, second) => took.slice(60 * second, 60 * (second + 1)));
    const medians = seconds.map((times) => times.sort((a, b) => a - b)[30]);
    took.sort((a, b) => a - b);
    const at = (part) => took[Math.floor(part * (FRAMES - 1))];
    return [name, at(0.5), at(0.99), at(1), Math.min(...medians)];
  });
  canvas.remove();
  return results;
});
