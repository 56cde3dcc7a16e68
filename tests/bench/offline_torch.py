"""Recordings to codes and back with scipy and PyTorch, f32, on one thread: the work of `host-sim encode` and `host-sim
decode`, timed for comparison by `cargo xtask bench offline`.

    python3 offline_torch.py FOLDER < REQUEST

REQUEST is one JSON object: artifact (folder), cells and electrodes, steps, hop, rows, columns, decimation, sd_uv, and the
filters (rate_hz, mains_hz, notch_q, band_hz, order). FOLDER has `samples.f32`, uV, [sample][electrode]; codes go to
`codes.f32`, decoded signals, uV, [step][electrode], to `decoded.f32`. Prints one JSON object: versions and seconds.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import scipy
import torch
from scipy import signal
from torch import nn
from torch.nn import functional
from torch_encoder import Encoder, load, tensors

# Windows in one call of the network: the fastest number on the machine on which this was written.
BATCH = 256


class Decoder(nn.Module):
    """Mode `shortcut` without padding, as docs/decoding.md describes it."""

    def __init__(self, weights, request):
        super().__init__()
        self.size = [request["steps"], request["rows"], request["columns"]]
        self.pooled = [(length - 4) // 2 for length in self.size]
        self.cells = torch.tensor(request["cells"])
        self.fc = nn.Linear(request["numbers"], 32 * int(np.prod(self.pooled)))
        self.conv1 = nn.ConvTranspose3d(32, 16, 3)
        self.norm1 = nn.BatchNorm3d(16)
        self.conv2 = nn.ConvTranspose3d(16, 1, 3)
        self.shortcut = nn.Linear(request["numbers"], self.size[0] * len(request["cells"]), bias=False)
        load(self, weights, "decoder.")

    def forward(self, z):
        x = self.fc(z).reshape(-1, 32, *self.pooled)
        x = functional.interpolate(x, size=[length - 4 for length in self.size], mode="nearest")
        x = self.norm1(torch.relu(self.conv1(x)))
        x = self.conv2(x).flatten(3)[:, 0].index_select(2, self.cells)
        return x + self.shortcut(z).reshape(x.shape)


def sections(request):
    """Returns notch and band-pass as second-order sections."""
    rate = request["rate_hz"]
    notch = signal.tf2sos(*signal.iirnotch(request["mains_hz"], request["notch_q"], rate))
    band = signal.butter(request["order"], request["band_hz"], "bandpass", fs=rate, output="sos")
    return np.vstack([notch, band])


def encode(folder, encoder, request):
    samples = np.fromfile(folder / "samples.f32", "<f4").reshape(-1, len(request["cells"]))
    filtered = signal.sosfilt(sections(request), samples.astype(float), axis=0)
    steps = (filtered[:: request["decimation"]] / request["sd_uv"]).astype(np.float32)
    planes = np.zeros((len(steps), request["rows"] * request["columns"]), np.float32)
    planes[:, request["cells"]] = steps
    windows = np.lib.stride_tricks.sliding_window_view(planes, request["steps"], axis=0)
    windows = windows[:: request["hop"]].transpose(0, 2, 1)
    shape = (-1, request["steps"], request["rows"], request["columns"])
    batches = range(0, len(windows), BATCH)
    codes = [
        encoder(torch.from_numpy(np.ascontiguousarray(windows[at : at + BATCH]).reshape(shape)))
        for at in batches
    ]
    codes = torch.cat(codes).numpy()
    codes.tofile(folder / "codes.f32")
    return codes


def decode(folder, decoder, request):
    codes = np.fromfile(folder / "codes.f32", "<f4").reshape(-1, request["numbers"])
    batches = range(0, len(codes), BATCH)
    windows = [decoder(torch.from_numpy(codes[at : at + BATCH])) for at in batches]
    windows = torch.cat(windows).numpy() * request["sd_uv"]
    hop, steps = request["hop"], request["steps"]
    rows = (len(codes) - 1) * hop + steps
    total = np.zeros((rows, windows.shape[2]), np.float32)
    count = np.zeros((rows, 1), np.float32)
    for part in range(0, steps, hop):
        block = windows[:, part : part + hop].reshape(-1, windows.shape[2])
        total[part : part + len(block)] += block
        count[part : part + len(block)] += 1
    (total / count).tofile(folder / "decoded.f32")


def main():
    folder = Path(sys.argv[1])
    request = json.load(sys.stdin)
    torch.set_num_threads(1)
    torch.set_num_interop_threads(1)
    weights = tensors(Path(request["artifact"]) / "weights.safetensors")
    with torch.no_grad():
        encoder = Encoder(weights, request["cells"]).eval()
        decoder = Decoder(weights, request).eval()
        # The first calls allocate and choose kernels.
        decoder(encoder(torch.zeros(BATCH, request["steps"], request["rows"], request["columns"])))
        start = time.perf_counter()
        encode(folder, encoder, request)
        encoded = time.perf_counter()
        decode(folder, decoder, request)
        decoded = time.perf_counter()
    answer = {
        "torch": torch.__version__,
        "scipy": scipy.__version__,
        "encode_s": encoded - start,
        "decode_s": decoded - encoded,
    }
    json.dump(answer, sys.stdout, allow_nan=False)


if __name__ == "__main__":
    main()
