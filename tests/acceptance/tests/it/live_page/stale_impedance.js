// Reports an impedance, and then nothing of it, and returns what the electrode says before and after.
return import('/head.js').then(async ({Head}) => {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg'), summary = document.createElement('p');
  const head = new Head(svg, summary, () => {});
  await head.show(['Cz']);
  const says = () => svg.querySelector('.electrode').getAttribute('aria-label');
  const values = new Map([['Cz', '4.9 kOhm']]);
  head.report([{level: 0, name: 'impedance', message: '', values}]);
  const all = [says()];
  for (let report = 0; report < 4; report += 1) {
    head.report([{level: 0, name: 'device', message: '', values: new Map()}]);
    all.push(says());
  }
  return all;
});
