// Feeds stores with 65 minutes of virtual time, and returns what they hold after some minutes, in bytes, with
// the mistakes that were found. `values` are sample index and channel.
return Promise.all([import('/store.js'), import('/traces.js')]).then(async ([{Store}, {Traces}]) => {
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; width: 930px; height: 600px; left: 0; top: 0';
  document.body.append(canvas);
  await new Promise((done) => setTimeout(done, 200));
  const mistakes = [];
  const run = (channels, rate, most, minutes) => {
    const labels = Array.from({length: channels}, (_, channel) => `E${channel}`), nsamples = rate / 16;
    const info = {nsamples, nchannels: channels, unit: 'uV', transducer: '', labels};
    const none = {...info, nchannels: 0, labels: []}, eegData = new Float32Array(nsamples * channels);
    const tri = new Int32Array(8 * nsamples);
    const frame = (number) => {
      for (let s = 0; s < nsamples; s += 1) {
        const index = number * nsamples + s, us = Math.round(index * 1e6 / rate);
        for (let c = 0; c < channels; c += 1) eegData[s * channels + c] = index % 1000 + c / 64;
        [tri[8 * s + 3], tri[8 * s + 4], tri[8 * s + 5]] = [us % 65536, Math.floor(us / 65536) % 65536, Math.floor(us / 2 ** 32)];
      }
      return {seq: number, rate, eeg: info, eegData, exg: none, exgData: new Float32Array(0), tri};
    };
    const store = new Store(frame(0), most), bytes = [], drawings = [], traces = new Traces(canvas, () => {});
    for (let minute = 0, number = 0; minute < minutes; minute += 1) {
      for (const end = number + 60 * 16; number < end; number += 1) store.append(frame(number));
      bytes.push(store.bytes);
      traces.show({store, name: 'raw', measured: true}, null, []);
      traces.hold(store.begun() + 20e6);
      const begun = performance.now();
      for (let k = 0; k < 5; k += 1) {
        traces.invalidate();
        traces.plot.draw(begun + k);
      }
      drawings.push((performance.now() - begun) / 5);
    }
    for (let index = store.first; index < store.next; index += 997) {
      if (store.value(index, 7) !== Math.fround(index % 1000 + 7 / 64)) mistakes.push(['value', index]);
      const at = store.at(store.time(index));
      if (at !== index) mistakes.push(['time', index, at]);
    }
    return {bytes, drawings, seconds: (store.end() - store.begun()) / 1e6};
  };
  const results = {steps: run(61, 128, 2 ** 29, 65), tablet: run(64, 512, 2 ** 26, 12), mistakes};
  canvas.remove();
  return results;
});
