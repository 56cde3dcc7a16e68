"""Computes a table of substitutions with numpy; shares no code with the trainer.

Usage: reference.py ELECTRODES FILE...; the files have float32 steps of all electrodes, microvolts.
"""

import json
import sys

import numpy as np

electrodes = int(sys.argv[1])
recordings = [np.fromfile(name, "<f4").reshape(-1, electrodes).astype(float) for name in sys.argv[2:]]
steps = np.concatenate(recordings)
penalty = 0.01 * np.mean(steps**2)
weights = np.zeros((electrodes, electrodes))
for electrode in range(electrodes):
    others = np.delete(np.arange(electrodes), electrode)
    # Ridge regression as least squares: one more row for each weight, with the target 0.
    more = np.sqrt(penalty * len(steps)) * np.eye(len(others))
    rows = np.vstack([steps[:, others], more])
    targets = np.concatenate([steps[:, electrode], np.zeros(len(others))])
    solution = np.linalg.lstsq(rows, targets, rcond=None)[0]
    weights[electrode, others] = np.clip(np.round(128 * solution), -127, 127)

energies = []
squares, signal = np.zeros(electrodes), np.zeros(electrodes)
for recording in recordings:
    innovations = recording - recording @ weights.T / 128
    squares += np.sum(innovations**2, axis=0)
    signal += np.sum(recording**2, axis=0)
    for start in range(0, len(recording) - 127, 128):
        energies.append(np.mean(innovations[start : start + 128] ** 2, axis=0))
typical = np.median(energies, axis=0)
typical = np.clip(typical, np.median(typical) / 4, np.median(typical) * 9)
nmse = squares / signal
result = {
    "weights": weights.astype(int).ravel().tolist(),
    "innovation": (typical * 16**2).tolist(),
    "figures": [np.median(nmse), np.max(nmse), "ABCDEFGH"[np.argmax(nmse)]],
}
print(json.dumps(result))
