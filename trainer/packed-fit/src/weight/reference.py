"""Root of the metric of a weighted error, in float64, for the test of the Rust code.

usage: reference.py ELECTRODES FILE, with filtered steps in uV (f32, little-endian, step by step). Prints the matrix, row
by row. Blocks of eight steps at 128 Hz, 8 to 30 Hz, strength 3.
"""

import sys

import numpy as np

electrodes = int(sys.argv[1])
x = np.fromfile(sys.argv[2], "<f4").reshape(-1, electrodes).astype(float)
# scipy.signal.butter(2, [8, 30], "bandpass", fs=128), as one filter of order 4.
b = 0.16278615157864088 * np.array([1, 0, -2, 0, 1])
a = [1, -1.7923001771813616, 1.4549186518924904, -0.7252874091521067, 0.23182101147987758]
for _ in range(2):
    y = np.zeros_like(x)
    for n in range(len(x)):
        y[n] = sum(b[k] * x[n - k] for k in range(5) if n >= k)
        y[n] -= sum(a[k] * y[n - k] for k in range(1, 5) if n >= k)
    x = y
c = x.T @ x
values, vectors = np.linalg.eigh(c)
s = vectors @ np.diag((values + 0.1 * np.median(values)) ** -0.5) @ vectors.T
s *= np.trace(c) / np.trace(c @ s)
lag = np.subtract.outer(np.arange(8), np.arange(8))
r = sum(sign * 2 * f / 128 * np.sinc(2 * f * lag / 128) for f, sign in ((30, 1), (8, -1)))
values, vectors = np.linalg.eigh(np.eye(8 * electrodes) + 3 * np.kron(r, s))
np.savetxt(sys.stdout, vectors @ np.diag(np.sqrt(values)) @ vectors.T)
