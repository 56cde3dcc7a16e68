"""The encoder in PyTorch, f32, on one thread, timed for comparison by `cargo xtask bench host`.

    python3 torch_encoder.py WEIGHTS CELLS CODES < WINDOWS

WINDOWS are f32, [window][step][row][column] of 16 time steps, 10 rows and 9 columns; CELLS are the cells of the
electrodes, separated by commas. Prints one JSON object: PyTorch's version, the values of the first CODES codes,
and codes per second with one window per call ("single") and with all windows in one call ("batch").
"""

import json
import struct
import sys
import time

import torch
from torch import nn

# Shortest duration of a measurement; tests/bench/src/report/host.rs has the same.
TURN_S = 0.2


def tensors(path):
    """Reads a safetensors file: length of the header (u64), header (JSON), numbers."""
    with open(path, "rb") as file:
        data = file.read()
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    numbers = bytearray(data[8 + length :])
    header.pop("__metadata__", None)
    return {
        name: torch.frombuffer(
            numbers,
            dtype={"F32": torch.float32}[entry["dtype"]],
            count=(entry["data_offsets"][1] - entry["data_offsets"][0]) // 4,
            offset=entry["data_offsets"][0],
        ).reshape(entry["shape"])
        for name, entry in header.items()
    }


def load(network, weights, prefix):
    """Loads the weights whose names start with `prefix`."""
    own = {
        name.removeprefix(prefix): tensor
        for name, tensor in weights.items()
        if name.startswith(prefix)
    }
    missing, unknown = network.load_state_dict(own, strict=False)
    left = [name for name in missing if not name.endswith("num_batches_tracked")]
    if left or unknown:
        sys.exit(f"the weights do not fit this network: {left} missing, {unknown} unknown")


class Encoder(nn.Module):
    def __init__(self, weights, cells):
        super().__init__()
        self.conv1 = nn.Conv3d(1, 16, 3)
        self.norm1 = nn.BatchNorm3d(16)
        self.conv2 = nn.Conv3d(16, 32, 3)
        self.norm2 = nn.BatchNorm3d(32)
        self.pool = nn.MaxPool3d(2)
        self.fc = nn.Linear(1152, 128)
        self.shortcut = nn.Linear(16 * len(cells), 128, bias=False)
        self.cells = torch.tensor(cells)
        load(self, weights, "encoder.")

    def forward(self, windows):
        x = windows.unsqueeze(1)
        x = self.norm1(torch.relu(self.conv1(x)))
        x = self.norm2(torch.relu(self.conv2(x)))
        x = self.fc(self.pool(x).flatten(1))
        electrodes = windows.flatten(2).index_select(2, self.cells)
        return x + self.shortcut(electrodes.flatten(1))


def speed(encoder, batches):
    """Returns codes per second, after one call that warms up."""
    encoder(batches[0])
    codes, start = 0, time.perf_counter()
    while time.perf_counter() - start < TURN_S:
        for batch in batches:
            codes += len(encoder(batch))
    return codes / (time.perf_counter() - start)


def main():
    _, weights, cells, codes = sys.argv
    torch.set_num_threads(1)
    torch.set_num_interop_threads(1)
    encoder = Encoder(tensors(weights), [int(cell) for cell in cells.split(",")]).eval()
    windows = torch.frombuffer(bytearray(sys.stdin.buffer.read()), dtype=torch.float32)
    windows = windows.reshape(-1, 16, 10, 9)
    with torch.no_grad():
        answer = {
            "version": torch.__version__,
            "codes": encoder(windows)[: int(codes)].flatten().tolist(),
            "single": speed(encoder, windows.split(1)),
            "batch": speed(encoder, [windows]),
        }
    json.dump(answer, sys.stdout, allow_nan=False)


if __name__ == "__main__":
    main()
