// @ts-check
// Ends of axes.

/** Least of 1, 2 and 5 times a power of ten that is not below `value`, which is above 0.
 * @param {number} value */
export function nice(value) {
  const ten = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((one) => one * ten).find((one) => one >= value) ?? 10 * ten;
}
