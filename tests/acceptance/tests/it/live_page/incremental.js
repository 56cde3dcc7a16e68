// Draws two streams that grow in frames, the second one later than the first, column by column, and returns
// the number of pixels that differ from a drawing of the whole plot at once.
return Promise.all([import('/store.js'), import('/traces.js')]).then(async ([{Store}, {Traces}]) => {
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; width: 700px; height: 300px; left: 0; top: 0';
  document.body.append(canvas);
  await new Promise((done) => setTimeout(done, 200));
  const labels = ['Fz', 'Cz', 'Pz'], wrong = [];
  for (const [rate, seconds] of [[128, 2], [128, 10], [512, 1], [512, 10]]) {
    const nsamples = rate / 16, info = {nsamples, nchannels: 3, unit: 'uV', transducer: '', labels};
    const none = {...info, nchannels: 0, labels: []};
    const frame = (number) => {
      const eegData = new Float32Array(3 * nsamples), tri = new Int32Array(8 * nsamples);
      for (let s = 0; s < nsamples; s += 1) {
        const index = number * nsamples + s, us = Math.round(index * 1e6 / rate);
        for (let c = 0; c < 3; c += 1) eegData[3 * s + c] = 40 * Math.sin(index * index * 0.37 + c);
        [tri[8 * s], tri[8 * s + 3], tri[8 * s + 4]] = [number % 40 === 0 ? 0x8000 : 0, us % 65536, Math.floor(us / 65536)];
      }
      return {seq: number, rate, eeg: info, eegData, exg: none, exgData: new Float32Array(0), tri};
    };
    const [first, second] = [new Store(frame(0), 2 ** 26), new Store(frame(0), 2 ** 26)];
    const traces = new Traces(canvas, () => {}), {plot} = traces;
    traces.seconds = seconds;
    plot.centre = () => [0, 0, 0];
    traces.show({store: first, name: 'a', measured: true}, {store: second, name: 'b', measured: false}, []);
    for (let number = 0; number < 400; number += 1) {
      first.append(frame(number));
      if (number > 2) second.append(frame(number - 2));
      if (number > 200) plot.draw(0);
    }
    const pixels = () => new Uint32Array(plot.context.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    const before = pixels();
    traces.invalidate();
    plot.draw(0);
    const after = pixels();
    const count = after.reduce((sum, pixel, k) => sum + Number(pixel !== before[k]), 0);
    if (count > 0) wrong.push([rate, seconds, count]);
  }
  canvas.remove();
  return wrong;
});
