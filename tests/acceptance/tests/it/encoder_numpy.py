"""The codes of an integer encoder, in numpy: python3 encoder_numpy.py FOLDER

Reads FOLDER/*.i64 (little endian), as numpy_reference.rs of this crate writes them, and writes FOLDER/codes.i16:
of each code the exponent, then the values.
Knows nothing of planes that come one by one, of transforms or of packed weights: every window is a batch of its
own, with convolutions over the whole of it, in int64 and in the order in which PyTorch keeps weights.
"""
import sys
from pathlib import Path

import numpy as np

FOLDER = Path(sys.argv[1])
# Number of windows computed at once. The patches of the second convolution then take up to 40 MB.
BATCH = 8


def array(name, *shape):
    return np.fromfile(FOLDER / f"{name}.i64", dtype="<i8").reshape(shape)


STEPS, ROWS, COLUMNS = array("window", 3)
ZERO_POINT = array("zero_point", -1)
NUMBERS = len(ZERO_POINT)


def rounded(product):
    """A Q32 number to the nearest integer, halves up."""
    return (product + (1 << 31)) // (1 << 32)


def padded(x, pads, values):
    """[window, channel, time, row, column] with each channel's own value beyond the edges."""
    around = [(0, 0)] + [(pad, pad) for pad in pads]
    channels = [np.pad(x[:, c], around, constant_values=value) for c, value in enumerate(values)]
    return np.stack(channels, axis=1)


def convolved(x, weights, bias):
    """[window, in, time, row, column] -> [window, out, time, row, column], unpadded, 3 x 3 x 3."""
    patches = np.lib.stride_tricks.sliding_window_view(x, (3, 3, 3), axis=(2, 3, 4))
    sums = np.tensordot(patches, weights, axes=([1, 5, 6, 7], [1, 2, 3, 4]))
    return np.moveaxis(sums + bias, -1, 1)


def activated(sums, multipliers):
    factors = multipliers.reshape(1, -1, 1, 1, 1)
    return np.clip(rounded(sums * factors), 0, 255)


def pooled(sums, pool):
    """Largest of each pool; what fills none is not read."""
    for axis, length in enumerate(pool, start=2):
        count = sums.shape[axis] // length
        sums = np.take(sums, range(count * length), axis)
        groups = sums.shape[:axis] + (count, length) + sums.shape[axis + 1 :]
        sums = sums.reshape(groups).max(axis + 1)
    return sums


class Convolutions:
    def __init__(self):
        self.pads, self.pool = array("pads", 3), array("pool", 3)
        self.hidden_padding = array("hidden_padding", 16)
        self.conv1 = array("conv1.weights", 16, 1, 3, 3, 3), array("conv1.bias", 16)
        self.conv2 = array("conv2.weights", 32, 16, 3, 3, 3), array("conv2.bias", 32)
        self.factors1, self.factors2 = array("conv1.multipliers", 16), array("conv2.multipliers", 32)
        self.fc, self.fc_bias = array("fc.weights", NUMBERS, -1), array("fc.bias", NUMBERS)
        self.fc_factors = array("fc.multipliers", NUMBERS)

    def codes(self, window):
        x = padded(window[:, None], self.pads, [0])
        hidden = activated(convolved(x, *self.conv1), self.factors1)
        sums = convolved(padded(hidden, self.pads, self.hidden_padding), *self.conv2)
        features = activated(pooled(sums, self.pool), self.factors2)
        return (features.reshape(len(window), -1) @ self.fc.T + self.fc_bias) * self.fc_factors


class Shortcut:
    def __init__(self):
        self.cells = array("cells", -1)
        self.weights = array("shortcut.weights", NUMBERS, STEPS * len(self.cells))
        self.factors = array("shortcut.multipliers", NUMBERS)

    def codes(self, window):
        electrodes = window.reshape(len(window), STEPS, ROWS * COLUMNS)[:, :, self.cells]
        return electrodes.reshape(len(window), -1) @ self.weights.T * self.factors


def formatted(steps):
    """Exponents and values of codes: the smallest power of two with which all values of one are in range."""
    least, greatest, largest = array("code.range", 3)
    exponents = np.full((len(steps), 1), largest)
    for exponent in reversed(range(largest)):
        values = (steps + 2**exponent // 2) // 2**exponent
        exponents[((values >= least) & (values <= greatest)).all(axis=1)] = exponent
    values = (steps + 2**exponents // 2) // 2**exponents
    return np.concatenate([exponents, np.clip(values, least, greatest)], axis=1)


def main():
    parts = [part() for part, is_there in zip((Convolutions, Shortcut), array("parts", 2)) if is_there]
    windows = array("windows", -1, STEPS, ROWS, COLUMNS)

    codes = []
    for first in range(0, len(windows), BATCH):
        window = windows[first : first + BATCH]
        codes.append(formatted(rounded(sum(part.codes(window) for part in parts)) + ZERO_POINT))
    codes = np.concatenate(codes)
    codes.astype("<i2").tofile(FOLDER / "codes.i16")
    values = codes[:, 1:]
    print(f"numpy {np.__version__}: {len(codes)} codes, {int(values.min())} .. {int(values.max())}")


main()
