// @ts-check
// Power spectral density of a segment of samples, as scipy.signal.welch computes each of its segments.

export class Periodogram {
  /** @param {number} rate samples per second; a segment has at least two seconds */
  constructor(rate) {
    this.rate = rate;
    /** Samples in a segment, a power of two. */
    this.length = 2 ** Math.ceil(Math.log2(2 * rate));
    /** Frequencies from 0 to half the rate. */
    this.bins = this.length / 2 + 1;
    /** Distance of two frequencies, Hz. */
    this.step = rate / this.length;
    const turn = 2 * Math.PI / this.length, points = new Float64Array(this.length);
    this.cos = points.map((_, n) => Math.cos(turn * n));
    this.sin = points.map((_, n) => Math.sin(turn * n));
    this.hann = this.cos.map((cos) => 0.5 - 0.5 * cos);
    this.gain = 2 / (rate * this.hann.reduce((sum, one) => sum + one * one, 0));
    this.re = points.slice();
    this.im = points.slice();
    const bits = Math.log2(this.length);
    this.reversed = Uint32Array.from(points, (_, n) => {
      let at = 0;
      for (let bit = 0; bit < bits; bit += 1) if (n >> bit & 1) at |= 1 << (bits - 1 - bit);
      return at;
    });
  }

  /**
   * Writes the one-sided density to `out`, for each frequency in squared units of the samples per Hz: without
   * the segment's mean, with a periodic Hann window.
   * @param {Float64Array} samples @param {Float32Array} out
   */
  density(samples, out) {
    const {length, re, im, hann, reversed, gain} = this;
    const mean = samples.reduce((sum, one) => sum + one, 0) / length;
    for (let n = 0; n < length; n += 1) re[reversed[n]] = (samples[n] - mean) * hann[n];
    im.fill(0);
    this.transform();
    for (let n = 0; n <= length / 2; n += 1) out[n] = gain * (re[n] * re[n] + im[n] * im[n]);
    out[0] /= 2;
    out[length / 2] /= 2;
  }

  /** Replaces `re` and `im`, in the order of reversed bits, by their discrete Fourier transform. */
  transform() {
    const {length, re, im, cos, sin} = this;
    for (let half = 1; half < length; half *= 2) {
      const stride = length / (2 * half);
      for (let start = 0; start < length; start += 2 * half) {
        for (let n = 0; n < half; n += 1) {
          const a = start + n, b = a + half, c = cos[n * stride], s = -sin[n * stride];
          const x = re[b] * c - im[b] * s, y = re[b] * s + im[b] * c;
          re[b] = re[a] - x;
          im[b] = im[a] - y;
          re[a] += x;
          im[a] += y;
        }
      }
    }
  }
}
