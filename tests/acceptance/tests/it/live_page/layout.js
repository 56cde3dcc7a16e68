// Returns what is outside of the page, overlaps or cannot be reached, in words.
const faults = [], [width, height] = [innerWidth, innerHeight], page = document.documentElement;
if (page.scrollWidth > width || page.scrollHeight > height) faults.push(`page of ${page.scrollWidth} x ${page.scrollHeight}`);
const box = (element) => element.getBoundingClientRect(), name = (element) => element.id || element.tagName;
const apart = (elements) => elements.forEach((one, k) => elements.slice(k + 1).forEach((other) => {
  const [a, b] = [box(one), box(other)];
  if (a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1) faults.push(`${name(one)} over ${name(other)}`);
}));
const shown = (selector) => [...document.querySelectorAll(selector)].filter((one) => box(one).width > 0);
apart(shown('header > h1, header > p, header label, header button'));
apart(shown('#plot, #cursor, #past, #legend, aside, header'));
const panels = shown('aside > details, aside > section');
apart(panels);
for (const element of shown('header select, header input, header button, #past input, #plot')) {
  const {left, right, top, bottom} = box(element);
  if (left < 0 || top < 0 || right > width || bottom > height) faults.push(`${name(element)} is outside`);
}
for (const element of shown('aside canvas, aside select, aside button, aside svg, aside input')) {
  element.scrollIntoView({block: 'center'});
  const {left, right, top, bottom} = box(element), aside = box(document.querySelector('aside'));
  if (left < aside.left || right > aside.right || bottom < aside.top || top > aside.bottom) faults.push(`${name(element)} cannot be reached`);
  const hit = document.elementFromPoint((left + right) / 2, Math.min(aside.bottom - 2, Math.max(aside.top + 2, (top + bottom) / 2)));
  if (!element.contains(hit)) faults.push(`${name(element)} is covered by ${hit && name(hit)}`);
}
if (box(document.getElementById('plot')).height < 250) faults.push('the plot is low');
document.querySelector('aside').scrollTop = 0;
return [faults, panels.length];
