"""The packed code as docs/packed.md states it, written for legibility: Viterbi over dictionaries, a range coder on
one long integer, no table of reciprocals.

usage: packed_python.py ARTIFACT STEPS RATE [RATE ...]

Reads filtered electrodes from STEPS (int32, little-endian, counts in Q27.5, step by step) and prints the bytes of each
block in hexadecimal and the CRC-32 of the state after it, one line for each block, the rates one after the other. Needs
nothing but Python's standard library.
"""

import json
import math
import struct
import sys
import tomllib
import zlib
from operator import mul
from pathlib import Path

LEVELS, ESCAPE, RESET, CAP = 64, 15, 64, 118
RATIO = math.log(8000) / 55
STEPS = [round(32 * 2 ** ((rate - 4) / 2)) for rate in range(16)]
SHIFTS = [round(math.log(2) / 2 / RATIO * (4 - rate)) for rate in range(16)]
EXPECTED = [round(16384 * min(15, 0.0015 * math.exp(RATIO * level))) for level in range(LEVELS)]
MOVES = [round(0.55 * math.log((i + 0.5) / 8) / RATIO) for i in range(64)]
NEXT = [(0, 2), (2, 0), (1, 3), (3, 1)]
BIT_COST = 1229


def tensors(path):
    """Returns the tensors of a safetensors file: lists of numbers with their shapes."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    formats = {"I8": "b", "U8": "B", "U16": "H", "I32": "i", "F32": "f"}
    for name, entry in header.items():
        if name != "__metadata__":
            start, end = (8 + length + offset for offset in entry["data_offsets"])
            kind = formats[entry["dtype"]]
            count = (end - start) // struct.calcsize(kind)
            yield name, (entry["shape"], struct.unpack(f"<{count}{kind}", data[start:end]))


def rows(tensor):
    shape, numbers = tensor
    return [numbers[at : at + shape[-1]] for at in range(0, len(numbers), shape[-1])]


def limit(value, most):
    return max(-most - (most == 32767), min(most, value))


def multiply(matrix, factors, inputs):
    """Returns the outputs of an integer matrix, rounded half up and saturated to 16 bits."""
    sums = (sum(map(mul, row, inputs)) for row in matrix)
    return [limit((total * factor + 2**31) >> 32, 32767) for total, factor in zip(sums, factors)]


def inverse(expected):
    """Returns 2^39 / expected, from the leading eight bits of `expected`."""
    zeros = 32 - expected.bit_length()
    leading = (expected << zeros) >> 24
    return (2**24 // (2 * leading + 1)) << zeros - 8


def contexts(levels, rate):
    expected, result = 8192 << 4, []
    for level in levels:
        level = max(0, min(LEVELS - 1, level + SHIFTS[rate]))
        result.append((level, inverse(expected)))
        expected += EXPECTED[level] - (expected >> 5)
    return result


def table_level(context, activity):
    level, scale = context
    return max(0, min(LEVELS - 1, level + MOVES[min(activity * scale >> 32, 63)]))


def after(activity, magnitude):
    return activity - (activity >> 5) + 1024 * min(magnitude, ESCAPE)


def costs(starts):
    """Returns the bits of each magnitude in 1/16, sign included."""
    ends = [*starts[1:], 2**15]
    counts = [end - start for start, end in zip(starts, ends)]
    return [min(255, math.floor((15 - math.log2(n) + (m > 0)) * 16 + 0.5)) for m, n in enumerate(counts)]


def quantise(residual, context, table, rate):
    """Returns the magnitudes with the least cost; values are in 1/256 of the step, costs in 1/65536 of its square."""
    reciprocal = -(-(2**34) // STEPS[rate])
    paths = {0: (0, 8192, ())}
    for value, here in zip(residual, context):
        value = abs(value) * reciprocal >> 26
        best = {}
        for state, (cost, activity, magnitudes) in sorted(paths.items()):
            quantiser = state >> 1
            row = table[quantiser * LEVELS + table_level(here, activity)]
            lower = ((value >> 8) + quantiser) >> 1
            candidates = [lower, lower + 1] + ([0] if lower == 1 else [])
            for magnitude in candidates:
                point = 2 * magnitude - quantiser if magnitude else 0
                bits = row[min(magnitude, ESCAPE)]
                total = cost + (value - 256 * point) ** 2 + BIT_COST * bits
                target = NEXT[state][magnitude & 1]
                if target not in best or total < best[target][0]:
                    best[target] = (total, after(activity, magnitude), (magnitudes, magnitude))
        paths = best
    _, _, chain = paths[min(sorted(paths), key=lambda state: paths[state][0])]
    result = []
    while chain:
        chain, magnitude = chain
        result.append(magnitude)
    return result[::-1]


class RangeEncoder:
    """The number so far is `low`, of which `bytes` bytes are final but for a carry."""

    def __init__(self):
        self.low, self.range, self.bytes = 0, 2**32 - 1, 0

    def put(self, start, count, bits):
        unit = self.range >> bits
        self.low += unit * start
        self.range = unit * count
        while self.range < 2**24:
            self.low <<= 8
            self.range <<= 8
            self.bytes += 1

    def bit(self, bit):
        self.put(bit, 1, 1)

    def finish(self):
        for zeros in range(8 * (self.bytes + 4), -1, -8):
            number = -(-self.low >> zeros) << zeros
            if number < self.low + self.range:
                break
        return number.to_bytes(self.bytes + 4, "big").rstrip(b"\0")


def write(magnitudes, residual, context, starts, rate, announced, is_reset):
    coder = RangeEncoder()
    if rate != announced:
        coder.put(32256, 512, 15)
        for bit in (8, 4, 2, 1):
            coder.bit(int(rate & bit > 0))
        coder.bit(int(is_reset))
    elif is_reset:
        coder.put(30720, 1536, 15)
    else:
        coder.put(0, 30720, 15)
    state, activity = 0, 8192
    for magnitude, value, here in zip(magnitudes, residual, context):
        row = [*starts[(state >> 1) * LEVELS + table_level(here, activity)], 2**15]
        symbol = min(magnitude, ESCAPE)
        coder.put(row[symbol], row[symbol + 1] - row[symbol], 15)
        if symbol == ESCAPE:
            escaped = bin(magnitude - ESCAPE + 1)[3:]
            for bit in "1" * len(escaped) + "0" + escaped:
                coder.bit(int(bit))
        if symbol:
            coder.bit(int(value < 0))
        activity = after(activity, magnitude)
        state = NEXT[state][magnitude & 1]
    return coder.finish()


class Encoder:
    def __init__(self, folder):
        self.packed = tomllib.loads((folder / "packed.toml").read_text())
        model = tomllib.loads((folder / "model.toml").read_text())
        adc = model["adc"]
        count_uv = 2e6 * adc["vref_v"] / adc["gain"] / 2**24
        self.multiplier = round(count_uv / 32 / self.packed["unit_uv"] * 2**32)
        self.electrodes = len(model["montage"]["electrodes"])
        self.hop = model["window"]["hop"]
        read = dict(tensors(folder / "packed.safetensors"))
        self.analysis, self.analysis_factors = rows(read["analysis.weight"]), read["analysis.factor"][1]
        self.prediction, self.prediction_factors = rows(read["prediction.weight"]), read["prediction.factor"][1]
        self.levels = {False: read["levels.predicted"][1], True: read["levels.reset"][1]}
        self.starts = rows(read["starts"])
        self.costs = [costs(row) for row in self.starts]

    def blocks(self, steps, announced):
        state, index = [0] * len(self.analysis), 0
        size = self.electrodes * self.hop
        for at in range(0, len(steps) - size + 1, size):
            inputs = [(x * self.multiplier + 2**31) >> 32 for x in steps[at : at + size]]
            inputs = [limit(x, self.packed["input_limit"]) for x in inputs]
            coefficients = multiply(self.analysis, self.analysis_factors, inputs)
            is_reset = index % RESET == 0
            rounded = [(s + 4) >> 3 for s in state]
            state = [0] * len(state) if is_reset else multiply(self.prediction, self.prediction_factors, rounded)
            residual = [y - p for y, p in zip(coefficients, state)]
            block, rate, magnitudes = self.block(residual, announced, is_reset)
            state = self.update(state, magnitudes, residual, rate)
            index += 1
            yield block, zlib.crc32(struct.pack(f"<{len(state)}h", *state))

    def block(self, residual, announced, is_reset):
        def attempt(rate):
            context = contexts(self.levels[is_reset], rate)
            magnitudes = quantise(residual, context, self.costs, rate)
            return write(magnitudes, residual, context, self.starts, rate, announced, is_reset), rate, magnitudes

        first = attempt(announced)
        if len(first[0]) <= CAP:
            return first
        coarser = 1 + -(-(len(first[0]) - CAP) // 22)
        second = attempt(min(15, announced + coarser))
        if len(second[0]) <= CAP:
            return second
        zeros = [0] * len(residual)
        context = contexts(self.levels[is_reset], announced)
        return write(zeros, residual, context, self.starts, announced, announced, is_reset), announced, zeros

    @staticmethod
    def update(state, magnitudes, residual, rate):
        quantiser_state, result = 0, []
        for before, magnitude, value in zip(state, magnitudes, residual):
            point = (2 * magnitude - (quantiser_state >> 1)) * STEPS[rate] if magnitude else 0
            result.append(limit(before + (-point if value < 0 else point), 32767))
            quantiser_state = NEXT[quantiser_state][magnitude & 1]
        return result


def main():
    folder, file, *rates = sys.argv[1:]
    data = Path(file).read_bytes()
    steps = struct.unpack(f"<{len(data) // 4}i", data)
    encoder = Encoder(Path(folder))
    for rate in rates:
        for block, state in encoder.blocks(steps, int(rate)):
            print(f"{block.hex() or '-'} {state:08x}")


main()
