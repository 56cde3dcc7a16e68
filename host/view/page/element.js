// @ts-check
// Elements of the page.

/**
 * Returns an element of index.html, which has the type that the caller states.
 * @template {Element} [T=HTMLElement]
 * @param {string} id
 * @returns {T}
 */
export const find = (id) => /** @type {T} */ (/** @type {unknown} */ (document.getElementById(id)));
