// @ts-check
// Computes which part of each column of pixels the traces of a store cross, and sets those pixels.

/** @typedef {import('./reference.js').Reference} Reference */
/** @typedef {import('./palette.js').Colour} Colour */

/**
 * A row of the plot: `channel` is the trace's in the store, `middle` the pixel row of the value `centre`,
 * `scale` pixels for each microvolt.
 * @typedef {{channel: number, middle: number, centre: number, scale: number, colour: Colour}} Row
 */

/** Index of the first sample of each column, and after the last column. Column `k` begins at the device
 * time `(first + k) * width`.
 * @param {import('./store.js').Store} store @param {number} first
 * @param {number} count columns @param {number} width microseconds */
export function starts(store, first, count, width) {
  const all = new Float64Array(count + 1);
  let from = store.at(first * width);
  for (let k = 0; k <= count; k += 1) {
    while (from < store.next && store.time(from) < (first + k) * width) from += 1;
    all[k] = from;
  }
  return all;
}

/**
 * Sets the pixels of the traces. In each column a trace covers all values that the straight lines between
 * its samples have there, so no sample is left out; the ends of this range are blended with the ground.
 * @param {ImageData} image one pixel for each column
 * @param {Reference} reference
 * @param {Row[]} rows drawn from the last to the first
 * @param {Float64Array} begins of the columns, from `starts`
 * @param {number} first @param {number} width as of `starts`
 * @param {number} thickness pixels
 */
export function draw(image, reference, rows, begins, first, width, thickness) {
  const {store} = reference, count = rows.length;
  const least = new Float64Array(count), greatest = new Float64Array(count);
  const pixels = new Uint32Array(image.data.buffer);
  const channels = Uint16Array.from(rows, (row) => row.channel);
  const middles = Float64Array.from(rows, (row) => row.middle + row.centre * row.scale);
  const scales = Float64Array.from(rows, (row) => row.scale);
  const {electrodes} = store;
  /** Adds a part of the sample at `a` and the rest of that at `b` to the ranges. A value of the average
   * reference is subtracted from electrodes only.
   * @param {number} a @param {number} b @param {number} part of `b` */
  const add = (a, b, part) => {
    const [one, other] = [store.chunk(a).values, store.chunk(b).values], [i, j] = [store.row(a), store.row(b)];
    const mean = reference.average ? reference.mean(a) * (1 - part) + reference.mean(b) * part : 0;
    for (let r = 0; r < count; r += 1) {
      const channel = channels[r], from = one[i + channel];
      let value = part === 0 ? from : from + (other[j + channel] - from) * part;
      if (channel < electrodes) value -= mean;
      if (value < least[r]) least[r] = value;
      if (value > greatest[r]) greatest[r] = value;
    }
  };
  /** Adds the values at the device time `time`, on the line to the sample at `index`.
   * @param {number} index @param {number} time */
  const cross = (index, time) => {
    if (index <= store.first || index >= store.next || store.gap(index)) return;
    const [from, to] = [store.time(index - 1), store.time(index)];
    if (to > from && time >= from && time <= to) add(index - 1, index, (time - from) / (to - from));
  };
  for (let k = 0; k + 1 < begins.length; k += 1) {
    const [from, to] = [begins[k], begins[k + 1]];
    least.fill(Infinity);
    greatest.fill(-Infinity);
    cross(from, (first + k) * width);
    for (let i = from; i < to; i += 1) add(i, i, 0);
    cross(to, (first + k + 1) * width);
    for (let r = count - 1; r >= 0; r -= 1) {
      if (least[r] > greatest[r]) continue;
      const top = middles[r] - greatest[r] * scales[r] - thickness / 2;
      const bottom = middles[r] - least[r] * scales[r] + thickness / 2;
      fill(image, pixels, k, top, bottom, rows[r].colour);
    }
  }
}

/** Sets the pixels of column `x` from `top` to `bottom`, which are between two pixels.
 * @param {ImageData} image @param {Uint32Array} pixels of the image @param {number} x
 * @param {number} top @param {number} bottom @param {Colour} colour */
function fill(image, pixels, x, top, bottom, colour) {
  const {width, height} = image;
  if (bottom <= 0 || top >= height) return;
  const whole = Math.max(0, Math.ceil(top)), end = Math.min(height, Math.floor(bottom));
  if (whole > end) return blend(image, x, whole - 1, bottom - top, colour);
  for (let y = whole; y < end; y += 1) pixels[y * width + x] = colour.word;
  blend(image, x, whole - 1, whole - top, colour);
  blend(image, x, end, bottom - end, colour);
}

/** @param {ImageData} image @param {number} x @param {number} y @param {number} part @param {Colour} colour */
function blend({data, width, height}, x, y, part, {red, green, blue}) {
  if (y < 0 || y >= height || part <= 0 || part >= 1) return;
  const at = 4 * (y * width + x);
  data[at] += (red - data[at]) * part;
  data[at + 1] += (green - data[at + 1]) * part;
  data[at + 2] += (blue - data[at + 2]) * part;
}
