// Draws one spike in 10 s of zeros, at many places, and returns those at which no pixel shows it. The plot has
// fewer columns than the store has samples.
return Promise.all([import('/store.js'), import('/traces.js')]).then(async ([{Store}, {Traces}]) => {
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; width: 646px; height: 118px; left: 0; top: 0';
  document.body.append(canvas);
  await new Promise((done) => setTimeout(done, 200));
  const rate = 512, count = 10 * rate, hidden = [];
  const info = {nsamples: 1, nchannels: 1, unit: 'uV', transducer: '', labels: ['Cz']};
  const none = {...info, nchannels: 0, labels: []};
  for (let spike = 600; spike < count - 600; spike += 37) {
    const frame = (i) => {
      const us = Math.round(i * 1e6 / rate), tri = new Int32Array(8);
      tri[3] = us % 65536;
      tri[4] = Math.floor(us / 65536);
      return {seq: i, rate, eeg: info, eegData: Float32Array.of(i === spike ? 40 : 0), exg: none,
        exgData: new Float32Array(0), tri};
    };
    const store = new Store(frame(0), 2 ** 26);
    for (let i = 0; i < count; i += 1) store.append(frame(i));
    const traces = new Traces(canvas, () => {});
    traces.show({store, name: 'raw', measured: true}, null, []);
    traces.plot.draw(performance.now());
    const {left, top, width, height} = traces.plot.geometry();
    // 20 uV above the middle of the only row, at 100 uV for its height.
    const y = Math.round(top + 0.3 * height);
    const row = traces.plot.context.getImageData(left, y, width, 1).data;
    const ground = row.slice(0, 4);
    let seen = 0;
    for (let x = 0; x < width; x += 1) if (row[4 * x] !== ground[0] || row[4 * x + 1] !== ground[1]) seen += 1;
    if (seen === 0) hidden.push(spike);
  }
  canvas.remove();
  return hidden;
});
