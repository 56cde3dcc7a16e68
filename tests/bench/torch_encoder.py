"""The encoder in PyTorch, f32, for `offline_torch.py` and `rospy_node.py`."""

import json
import struct
import sys

import torch
from torch import nn


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
