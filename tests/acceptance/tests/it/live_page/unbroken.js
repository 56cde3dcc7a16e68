// Draws one trace whose samples are at the borders of columns, and returns the columns in which it does not touch
// the column before.
return Promise.all([import('/store.js'), import('/traces.js')]).then(async ([{Store}, {Traces}]) => {
  const canvas = document.createElement('canvas');
  // 640 columns beside the labels: 3125 us each in 2 s, where samples are 7812.5 us apart.
  canvas.style.cssText = 'position: fixed; width: 686px; height: 233px; left: 0; top: 0';
  document.body.append(canvas);
  await new Promise((done) => setTimeout(done, 200));
  const info = {nsamples: 1, nchannels: 1, unit: 'uV', transducer: '', labels: ['Cz']};
  const none = {...info, nchannels: 0, labels: []};
  const frame = (i) => {
    const us = Math.round(i * 7812.5), tri = Int32Array.of(0, 0, 0, us % 65536, Math.floor(us / 65536), 0, 0, 0);
    return {seq: i, rate: 128, eeg: info, eegData: Float32Array.of(40 * Math.sin(i * i)), exg: none, exgData: new Float32Array(0), tri};
  };
  const store = new Store(frame(0), 2 ** 26), traces = new Traces(canvas, () => {}), {plot} = traces;
  for (let i = 0; i < 500; i += 1) store.append(frame(i));
  traces.seconds = 2;
  plot.centre = () => [0];
  traces.show({store, name: 'raw', measured: true}, null, []);
  plot.draw(0);
  const {left, top, width, height} = plot.geometry();
  const pixels = new Uint32Array(plot.context.getImageData(left, top, width, height).data.buffer);
  const ground = pixels[0], breaks = [];
  const range = (x) => {
    const rows = [...Array(height).keys()].filter((y) => pixels[y * width + x] !== ground);
    return [rows[0], rows[rows.length - 1]];
  };
  // The newest sample is in the last column; the line ends there.
  for (let x = 1; x + 1 < width; x += 1) {
    const [[a, b], [c, d]] = [range(x - 1), range(x)];
    if (!(a <= d + 1 && c <= b + 1)) breaks.push(x);
  }
  canvas.remove();
  return width === 640 ? breaks : [`${width} columns`];
});
