"""Training of the autoencoder in PyTorch, f32, on one thread, timed for comparison by `cargo xtask bench training`.

    python3 training_torch.py FOLDER REQUEST

FOLDER has `windows.f32`, [window][step][electrode]. REQUEST is one JSON object: model (see offline_torch.py), batch,
warm_up (updates that are not timed) and rate (the learning rate; the shortcut has a hundredth of it). Prints one JSON
object: PyTorch's version, processor time of the timed updates in seconds, and the loss of each batch.
"""

import json
import sys
import time
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional
from torch_encoder import tensors


class Autoencoder(nn.Module):
    """Mode `shortcut` without padding; the names are those of the weights."""

    def __init__(self, model):
        super().__init__()
        size = [model["steps"], model["rows"], model["columns"]]
        self.size, self.cells = size, torch.tensor(model["cells"])
        self.mapped = [length - 4 for length in size]
        self.pooled = [length // 2 for length in self.mapped]
        flat, numbers = 32 * self.pooled[0] * self.pooled[1] * self.pooled[2], model["numbers"]
        values = size[0] * len(model["cells"])
        self.encoder = nn.ModuleDict(
            {
                "conv1": nn.Conv3d(1, 16, 3),
                "norm1": nn.BatchNorm3d(16),
                "conv2": nn.Conv3d(16, 32, 3),
                "norm2": nn.BatchNorm3d(32),
                "fc": nn.Linear(flat, numbers),
                "shortcut": nn.Linear(values, numbers, bias=False),
            }
        )
        self.decoder = nn.ModuleDict(
            {
                "fc": nn.Linear(numbers, flat),
                "conv1": nn.ConvTranspose3d(32, 16, 3),
                "norm1": nn.BatchNorm3d(16),
                "conv2": nn.ConvTranspose3d(16, 1, 3),
                "shortcut": nn.Linear(numbers, values, bias=False),
            }
        )

    def forward(self, electrodes):
        count = len(electrodes)
        cells = torch.zeros(count, self.size[0], self.size[1] * self.size[2])
        cells[:, :, self.cells] = electrodes
        electrodes = electrodes.flatten(1)
        encoder, decoder = self.encoder, self.decoder
        x = torch.relu(encoder["conv1"](cells.reshape(count, 1, *self.size)))
        x = torch.relu(encoder["conv2"](encoder["norm1"](x)))
        x = functional.max_pool3d(encoder["norm2"](x), 2).flatten(1)
        code = encoder["fc"](x) + encoder["shortcut"](electrodes)
        x = decoder["fc"](code).reshape(count, 32, *self.pooled)
        x = functional.interpolate(x, size=self.mapped, mode="nearest")
        x = decoder["norm1"](torch.relu(decoder["conv1"](x)))
        x = decoder["conv2"](x).reshape(count, self.size[0], -1)[:, :, self.cells]
        return x.flatten(1) + decoder["shortcut"](code)


def main():
    folder, request = Path(sys.argv[1]), json.loads(sys.argv[2])
    torch.set_num_threads(1)
    torch.set_num_interop_threads(1)
    model = request["model"]
    network = Autoencoder(model)
    missing, unknown = network.load_state_dict(
        tensors(Path(model["artifact"]) / "weights.safetensors"), strict=False
    )
    left = [name for name in missing if not name.endswith("num_batches_tracked")]
    if left or unknown:
        sys.exit(f"the weights do not fit this network: {left} missing, {unknown} unknown")
    named = list(network.named_parameters())
    slow = [value for name, value in named if "shortcut" in name]
    fast = [value for name, value in named if "shortcut" not in name]
    rate = request["rate"]
    adam = torch.optim.Adam([{"params": fast, "lr": rate}, {"params": slow, "lr": rate / 100}])
    windows = torch.from_file(
        str(folder / "windows.f32"), size=(folder / "windows.f32").stat().st_size // 4
    ).reshape(-1, model["steps"], len(model["cells"]))
    losses, start = [], time.process_time()
    for index, batch in enumerate(windows.split(request["batch"])):
        if index == request["warm_up"]:
            start = time.process_time()
        adam.zero_grad(set_to_none=True)
        loss = functional.mse_loss(network(batch), batch.flatten(1))
        loss.backward()
        adam.step()
        losses.append(loss.item())
    seconds = time.process_time() - start
    answer = {"version": torch.__version__, "seconds": seconds, "losses": losses}
    json.dump(answer, sys.stdout, allow_nan=False)


if __name__ == "__main__":
    main()
