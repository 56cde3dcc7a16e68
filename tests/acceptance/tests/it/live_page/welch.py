"""Welch's method with numpy, from its definition: usage `welch.py FOLDER`.

Reads `samples.json`: `rate`, `length` of a segment, `values` and `fillers` (0 or 1) of consecutive samples.
Writes `spectrum.json`: the one-sided `density`, and the number of segments `used`.
"""

import json
import pathlib
import sys

import numpy

folder = pathlib.Path(sys.argv[1])
given = json.loads((folder / "samples.json").read_text())
values, fillers = numpy.array(given["values"]), numpy.array(given["fillers"])
rate, length = given["rate"], given["length"]
# A periodic Hann window, as scipy.signal.welch has.
window = numpy.hanning(length + 1)[:-1]
densities = []
for start in range(0, len(values) - length + 1, length // 2):
    if fillers[start : start + length].any():
        continue
    segment = values[start : start + length]
    power = numpy.abs(numpy.fft.rfft((segment - segment.mean()) * window)) ** 2
    density = power / (rate * numpy.sum(window**2))
    density[1:-1] *= 2
    densities.append(density)
density = numpy.mean(densities, axis=0) if densities else numpy.zeros(length // 2 + 1)
(folder / "spectrum.json").write_text(json.dumps({"density": density.tolist(), "used": len(densities)}))
