"""Prints scipy_rates.csv: outputs of scipy's double-precision filters for the test signal, in counts.

python3 scipy_rates.py > scipy_rates.csv   (scipy 1.17.1, numpy 2)
"""

import numpy as np
from scipy import signal

CUTOFF_HZ, BETA, STEP_HZ = 62.0, 5.0, 128


def counts(length):
    """Returns 20 mV of offset plus noise of at most 46 uV in whole counts, as in the test."""
    state, values = 1, []
    for _ in range(length):
        state = (state * 1_664_525 + 1_013_904_223) % 2**32
        values.append(894_784 + (state >> 20) - 2_048)
    return np.array(values, dtype=float)


def steps(x, rate, mains, decimation):
    b, a = signal.iirnotch(mains, 30, fs=rate)
    y = signal.lfilter(b, a, x)
    y = signal.sosfilt(signal.butter(5, [0.5, 60], "bandpass", fs=rate, output="sos"), y)
    if decimation == "literal":
        return y[:: rate // STEP_HZ]
    common = np.gcd(rate, STEP_HZ)
    up, down = STEP_HZ // common, rate // common
    taps = (-(-rate // 8) + 3) // 4 * 4
    h = signal.firwin(up * taps, CUTOFF_HZ, window=("kaiser", BETA), fs=rate * up)
    for phase in range(up):  # normalise each phase, so that a constant passes unchanged
        h[phase::up] /= h[phase::up].sum()
    return signal.upfirdn(h, y, up, down)[: -(-len(x) * up // down)]


print("# rate, mains, decimation, outputs 384, 392 .. 504 of 4 s, counts")
for rate in (250, 256, 500, 512, 1000, 1024):
    x = counts(4 * rate)
    for mains in (50, 60):
        for decimation in ("literal", "fir") if rate % STEP_HZ == 0 else ("fir",):
            y = steps(x, rate, mains, decimation)
            picked = ",".join(f"{v:.6f}" for v in y[384:512:8])
            print(f"{rate},{mains},{decimation},{picked}")
