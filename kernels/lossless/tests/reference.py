"""The block format of docs/wire-format.md, written a second time: bits are characters, numbers are Python's.

Reads from standard input: a line with the number of channels and of blocks per key block, then one line for each
block, its counts sample by sample, or an empty line for a gap. Prints one line for each block: its kind (0, 1 or
2) and its bytes in hexadecimal. Each block is decoded again, and must yield its counts."""

import sys

ESCAPE = "0" * 8


def differences(past, count):
    """Returns a count with its first, second and third difference."""
    rows = [count]
    for row in past:
        rows.append(rows[-1] - row)
    return rows


def binary(number, width):
    return format(number & ((1 << width) - 1), "0%db" % width)


def signed(bits):
    return int(bits, 2) - (1 << len(bits)) * int(bits[0])


def fold(difference):
    return 2 * difference if difference >= 0 else -2 * difference - 1


class Channel:
    def __init__(self):
        self.past, self.mean, self.order = [0, 0, 0], 0, 1

    def start(self, first, order, k):
        self.past, self.order, self.mean = [first, 0, 0], order, 24 * 2**k

    def k(self):
        return min(max(1, self.mean // 16).bit_length() - 1, 24)

    def append(self, count):
        rows = differences(self.past, count)
        self.past = rows[:3]
        return fold(rows[self.order])

    def observe(self, folded):
        self.mean += sum(folded) - self.mean // 16 * len(folded)


class Encoder:
    def __init__(self, channels, key_blocks):
        self.channels = [Channel() for _ in range(channels)]
        self.sizes = [[0] * 4 for _ in range(channels)]
        self.key_blocks, self.until_key = key_blocks, 0

    def choose(self, sizes, counts):
        past, block = [counts[0], 0, 0], [0] * 4
        for order in range(4):
            sizes[order] -= sizes[order] // 4
        for time, count in enumerate(counts[1:]):
            rows = differences(past, count)
            past = rows[:3]
            for order in range(4):
                block[order] += abs(rows[order])
                sizes[order] += abs(rows[order]) if time >= 2 else 0
        order = sizes.index(min(sizes))
        mean = block[order] // 4 + block[order] // 32
        return order, min(max(1, mean).bit_length() - 1, 24)

    def encode(self, samples):
        is_key = self.until_key == 0
        self.until_key = (self.key_blocks if is_key else self.until_key) - 1
        bits = ""
        for channel, sizes, counts in zip(self.channels, self.sizes, zip(*samples)):
            if is_key:
                order, k = self.choose(sizes, counts)
                channel.start(counts[0], order, k)
                bits += binary(counts[0], 24) + binary(order, 2) + binary(k, 5)
                counts = counts[1:]
            k, folded = channel.k(), []
            for count in counts:
                folded.append(channel.append(count))
                zeros = folded[-1] >> k
                if zeros < 8:
                    bits += "0" * zeros + "1" + (binary(folded[-1], k) if k else "")
                else:
                    bits += ESCAPE + binary(count, 24)
            channel.observe(folded)
        total = sum(channel.past[0] for channel in self.channels) % 65536
        verbatim = b"".join((count % 2**24).to_bytes(3, "little") for row in samples for count in row)
        # Words of 32 bits must fit, except the last bytes.
        if 2 + len(bits) // 32 * 4 + (4 if len(bits) % 32 else 0) > len(verbatim):
            self.until_key = 0
            return 0, verbatim
        bits += "0" * (-len(bits) % 8)
        data = bytes(int(bits[at : at + 8], 2) for at in range(0, len(bits), 8))
        return 1 if is_key else 2, total.to_bytes(2, "little") + data


class Decoder:
    def __init__(self, channels):
        self.channels = [Channel() for _ in range(channels)]

    def decode(self, kind, samples, data):
        width = len(self.channels)
        if kind == 0:
            counts = [int.from_bytes(data[at : at + 3], "little", signed=True) for at in range(0, len(data), 3)]
            return [counts[at : at + width] for at in range(0, len(counts), width)]
        bits = "".join(binary(byte, 8) for byte in data[2:])
        columns, at = [], 0
        for channel in self.channels:
            column = []
            if kind == 1:
                first, order, k = signed(bits[at : at + 24]), int(bits[at + 24 : at + 26], 2), int(bits[at + 26 : at + 31], 2)
                channel.start(first, order, k)
                column.append(first)
                at += 31
            k, folded = channel.k(), []
            while len(column) < samples:
                if bits.startswith(ESCAPE, at):
                    count = signed(bits[at + 8 : at + 32])
                    at += 32
                else:
                    one = bits.index("1", at)
                    low = bits[one + 1 : one + 1 + k]
                    number = (one - at) * 2**k + (int(low, 2) if low else 0)
                    at = one + 1 + k
                    count = number // 2 if number % 2 == 0 else -(number + 1) // 2
                    # The differences of lower orders that the next count has by this difference.
                    for row in reversed(channel.past[: channel.order]):
                        count += row
                column.append(count)
                folded.append(channel.append(count))
            channel.observe(folded)
            columns.append(column)
        assert set(bits[at:]) <= {"0"} and len(bits) - at < 8, "bits left over"
        total = sum(channel.past[0] for channel in self.channels) % 65536
        assert total == int.from_bytes(data[:2], "little"), "sum"
        return [list(row) for row in zip(*columns)]


def main():
    width, key_blocks = map(int, sys.stdin.readline().split())
    encoder, decoder = Encoder(width, key_blocks), Decoder(width)
    for line in sys.stdin:
        counts = list(map(int, line.split()))
        if not counts:
            encoder.until_key = 0
            continue
        samples = [counts[at : at + width] for at in range(0, len(counts), width)]
        kind, data = encoder.encode(samples)
        assert decoder.decode(kind, len(samples), data) == samples, "the decoded counts differ"
        print(kind, data.hex())


main()
