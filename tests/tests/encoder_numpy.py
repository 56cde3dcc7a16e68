"""The codes of an integer encoder, in numpy: python3 encoder_numpy.py FOLDER

Reads FOLDER/*.i64 (little endian), as encoder_numpy.rs beside this file writes them, and writes FOLDER/codes.i8.
Knows nothing of planes that come one by one, of transforms or of packed weights: every window is a batch of its
own, with convolutions over the whole of it, in int64 and in the order in which PyTorch keeps weights.
"""
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(sys.argv[1])
STEPS, ROWS, COLUMNS = 16, 10, 9
# Windows that are computed at once: what lies side by side for the second convolution takes 35 MB.
BATCH = 32


def array(name, *shape):
    return np.fromfile(FOLDER / f"{name}.i64", dtype="<i8").reshape(shape)


def rounded(product):
    """A Q32 number to the nearest integer, halves up."""
    return (product + (1 << 31)) // (1 << 32)


def convolved(x, weights, bias):
    """[window, in, time, row, column] -> [window, out, time, row, column], unpadded, 3 x 3 x 3."""
    patches = np.lib.stride_tricks.sliding_window_view(x, (3, 3, 3), axis=(2, 3, 4))
    sums = np.tensordot(patches, weights, axes=([1, 5, 6, 7], [1, 2, 3, 4]))
    return np.moveaxis(sums + bias, -1, 1)


def activated(sums, multipliers):
    factors = multipliers.reshape(1, -1, 1, 1, 1)
    return np.clip(rounded(sums * factors), 0, 255)


def pooled(sums):
    """Largest of 2 x 2 x 2; an odd last column is not read."""
    batch, channels, times, rows, columns = sums.shape
    times, rows, columns = times // 2, rows // 2, columns // 2
    blocks = sums[:, :, : 2 * times, : 2 * rows, : 2 * columns]
    blocks = blocks.reshape(batch, channels, times, 2, rows, 2, columns, 2)
    return blocks.max(axis=(3, 5, 7))


def main():
    conv1 = array("conv1.weights", 16, 1, 3, 3, 3), array("conv1.bias", 16)
    conv2 = array("conv2.weights", 32, 16, 3, 3, 3), array("conv2.bias", 32)
    factors1, factors2 = array("conv1.multipliers", 16), array("conv2.multipliers", 32)
    fc, fc_bias = array("fc.weights", 128, 32 * 6 * 3 * 2), array("fc.bias", 128)
    cells = array("cells", 61)
    shortcut = array("shortcut.weights", 128, STEPS * 61)
    fc_factors, shortcut_factors = array("fc.multipliers", 128), array("shortcut.multipliers", 128)
    zero_point = array("zero_point", 128)
    windows = array("windows", -1, STEPS, ROWS, COLUMNS)

    codes = []
    for first in range(0, len(windows), BATCH):
        window = windows[first : first + BATCH]
        hidden = activated(convolved(window[:, None], *conv1), factors1)
        features = activated(pooled(convolved(hidden, *conv2)), factors2)
        electrodes = window.reshape(len(window), STEPS, ROWS * COLUMNS)[:, :, cells]
        deep = features.reshape(len(window), -1) @ fc.T + fc_bias
        direct = electrodes.reshape(len(window), -1) @ shortcut.T
        code = rounded(deep * fc_factors + direct * shortcut_factors) + zero_point
        codes.append(np.clip(code, -128, 127))
    codes = np.concatenate(codes)
    codes.astype(np.int8).tofile(FOLDER / "codes.i8")
    print(f"numpy {np.__version__}: {len(codes)} codes, {int(codes.min())} .. {int(codes.max())}")


main()
