"""The float network of an artifact, in numpy: python3 float_numpy.py FOLDER

FOLDER is an artifact with windows.f32 beside it: step, row, column; uV over the input's standard deviation. Writes
codes.f64 and, where the code decodes by itself, windows.f64: step, electrode. In float64 throughout, with every
convolution as windows over a padded volume, the transposed ones with mirrored kernels.
"""
import json
import sys
import tomllib
from pathlib import Path

import numpy as np

FOLDER = Path(sys.argv[1])
DESCRIPTION = tomllib.loads((FOLDER / "model.toml").read_text())
MODE = DESCRIPTION["mode"]
WINDOW = DESCRIPTION["window"]["steps"], DESCRIPTION["grid"]["rows"], DESCRIPTION["grid"]["columns"]
ELECTRODES = len(DESCRIPTION["montage"]["electrodes"])
POOL = DESCRIPTION["network"]["pool"]
# Steps, rows, columns added on either side.
PADS = {"none": (0, 0, 0), "space": (0, 1, 1), "all": (1, 1, 1)}[DESCRIPTION["network"]["padding"]]


def tensors():
    """A .safetensors file: length of the header, header in JSON, numbers."""
    raw = (FOLDER / "weights.safetensors").read_bytes()
    start = 8 + int.from_bytes(raw[:8], "little")
    header = json.loads(raw[8:start])
    header.pop("__metadata__", None)
    for name, entry in header.items():
        first, last = entry["data_offsets"]
        numbers = np.frombuffer(raw[start + first : start + last], "<f4")
        yield name, numbers.reshape(entry["shape"]).astype(np.float64)


W = dict(tensors())


def correlated(x, weights, bias, pads):
    """[in, t, r, c] and [out, in, 3, 3, 3] -> [out, ...], with zeros beyond the edges."""
    x = np.pad(x, [(0, 0)] + [(pad, pad) for pad in pads])
    patches = np.lib.stride_tricks.sliding_window_view(x, (3, 3, 3), axis=(1, 2, 3))
    return np.einsum("itrcxyz,oixyz->otrc", patches, weights, optimize=True) + bias[:, None, None, None]


def transposed(x, name):
    """The same seen from the output: weights [in, out, 3, 3, 3] mirrored, and two cells less padding."""
    weights = W[f"{name}.weight"].swapaxes(0, 1)[:, :, ::-1, ::-1, ::-1]
    return correlated(x, weights, W[f"{name}.bias"], [2 - pad for pad in PADS])


def normed(x, name):
    """Batch norm behind a ReLU."""
    weight, bias, mean, variance = (
        W[f"{name}.{part}"][:, None, None, None] for part in ("weight", "bias", "running_mean", "running_var")
    )
    return (np.maximum(x, 0) - mean) / np.sqrt(variance + 1e-5) * weight + bias


def pooled(x):
    for axis, length in enumerate(POOL, start=1):
        groups = [range(first, first + length) for first in range(0, x.shape[axis] - length + 1, length)]
        x = np.stack([np.take(x, group, axis).max(axis) for group in groups], axis)
    return x


def feature_map():
    return [length - 4 + 4 * pad for length, pad in zip(WINDOW, PADS)]


def cells():
    labels = [label for row in DESCRIPTION["grid"]["cells"] for label in row]
    return [labels.index(label) for label in DESCRIPTION["montage"]["electrodes"]]


def encoded(window):
    code = np.zeros(DESCRIPTION["code"]["numbers"])
    if MODE != "pca":
        x = correlated(window[None], W["encoder.conv1.weight"], W["encoder.conv1.bias"], PADS)
        x = normed(x, "encoder.norm1")
        x = correlated(x, W["encoder.conv2.weight"], W["encoder.conv2.bias"], PADS)
        assert list(x.shape[1:]) == feature_map(), x.shape
        x = pooled(normed(x, "encoder.norm2"))
        code += W["encoder.fc.weight"] @ x.ravel() + W["encoder.fc.bias"]
    if MODE in ("shortcut", "pca"):
        code += W["encoder.shortcut.weight"] @ window.reshape(WINDOW[0], -1)[:, cells()].ravel()
    return code


def decoded(code):
    window = np.zeros((WINDOW[0], ELECTRODES))
    if MODE != "pca":
        x = W["decoder.fc.weight"] @ code + W["decoder.fc.bias"]
        lengths = [length // pool for length, pool in zip(feature_map(), POOL)]
        x = x.reshape(32, *lengths)
        for axis, (length, few) in enumerate(zip(feature_map(), lengths), start=1):
            x = np.take(x, [position * few // length for position in range(length)], axis)
        x = normed(transposed(x, "decoder.conv1"), "decoder.norm1")
        x = transposed(x, "decoder.conv2")
        window += x.reshape(WINDOW[0], -1)[:, cells()]
    if MODE in ("shortcut", "pca"):
        window += (W["decoder.shortcut.weight"] @ code).reshape(WINDOW[0], ELECTRODES)
    return window


def main():
    windows = np.fromfile(FOLDER / "windows.f32", "<f4").reshape(-1, *WINDOW).astype(np.float64)
    codes = np.array([encoded(window) for window in windows])
    codes.tofile(FOLDER / "codes.f64")
    if MODE != "paper":
        np.array([decoded(code) for code in codes]).tofile(FOLDER / "windows.f64")


main()
