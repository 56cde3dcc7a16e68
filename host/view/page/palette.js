// @ts-check
// Colours of the page's style, as canvases and pixels need them.

/** @typedef {{css: string, red: number, green: number, blue: number, word: number}} Colour `word` is a
 * pixel of an ImageData, whose bytes are red, green, blue and alpha */

/** @type {Map<string, Colour>} */
let known = new Map();
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { known = new Map(); });

/** @param {string} name of a variable in style.css, without dashes; its value is `#rrggbb` @returns {Colour} */
export function colour(name) {
  let one = known.get(name);
  if (!one) {
    const css = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    const [red, green, blue] = [1, 3, 5].map((at) => parseInt(css.slice(at, at + 2), 16));
    one = {css, red, green, blue, word: (255 << 24 | blue << 16 | green << 8 | red) >>> 0};
    known.set(name, one);
  }
  return one;
}

/** Gives a canvas the size that it has on the screen.
 * @param {HTMLCanvasElement} canvas
 * @returns {CanvasRenderingContext2D} */
export function fit(canvas) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((one) => Math.round(one * devicePixelRatio));
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  return /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d', {alpha: false}));
}
