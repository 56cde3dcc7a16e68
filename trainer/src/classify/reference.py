"""Computes float filters and decision with numpy; shares no code with the trainer.

Usage: reference.py ELECTRODES TRIALS FILE...; the files have float32 steps of all electrodes,
microvolts; TRIALS is a JSON list of [file, first step, last step + 1, class]. Two classes, six
filters, 8 to 30 Hz at 128 Hz.
"""

import json
import sys

import numpy as np

electrodes = int(sys.argv[1])
trials = json.loads(sys.argv[2])
steps = [np.fromfile(name, "<f4").reshape(-1, electrodes).astype(float) for name in sys.argv[3:]]
# scipy.signal.butter(2, [8, 30], "bandpass", fs=128), as one filter of order 4.
b = 0.16278615157864088 * np.array([1, 0, -2, 0, 1])
a = [1, -1.7923001771813616, 1.4549186518924904, -0.7252874091521067, 0.23182101147987758]
filtered = []
for x in steps:
    y = np.zeros_like(x)
    for n in range(len(x)):
        y[n] = sum(b[k] * x[n - k] for k in range(5) if n >= k)
        y[n] -= sum(a[k] * y[n - k] for k in range(1, 5) if n >= k)
    filtered.append(y)
classes = np.array([trial[3] for trial in trials])
moments = np.array([np.cov(filtered[f][i:j].T, bias=True) for f, i, j, _ in trials])
means = np.array([filtered[f][i:j].mean(0) for f, i, j, _ in trials])
moments += means[:, :, None] * means[:, None]
normalised = moments / np.trace(moments, axis1=1, axis2=2)[:, None, None]
own = [0.99 * normalised[classes == c].mean(0) + 0.01 * np.eye(electrodes) / electrodes for c in (0, 1)]
values, vectors = np.linalg.eig(np.linalg.solve(own[0] + own[1], own[0]))
vectors = vectors.real[:, np.argsort(-values.real)]
filters = np.hstack([vectors[:, :3], vectors[:, :-4:-1]])
filters /= np.sqrt(np.einsum("ef,ed,df->f", filters, own[0] + own[1], filters))
x = np.log(np.einsum("ef,ted,df->tf", filters, moments, filters))
centres = np.array([x[classes == c].mean(0) for c in (0, 1)])
residuals = x - centres[classes]
n, p = residuals.shape
covariance = residuals.T @ residuals / n
# Ledoit and Wolf 2004, lemmata 3.2 to 3.4.
mean = np.trace(covariance) / p
d2 = np.sum((covariance - mean * np.eye(p)) ** 2) / p
b2 = sum(np.sum((np.outer(r, r) - covariance) ** 2) / p for r in residuals) / n**2
shrinkage = min(b2, d2) / d2
shrunk = (1 - shrinkage) * covariance + shrinkage * mean * np.eye(p)
weights = np.linalg.solve(shrunk, centres[1] - centres[0])
bias = -0.5 * (centres[0] + centres[1]) @ weights
print(json.dumps({"filters": filters.T.tolist(), "weights": weights.tolist(), "bias": bias}))
