"""The paper's node in rospy, timed for comparison by `cargo xtask bench node`.

    python3 rospy_node.py INPUT OUTPUT LENGTH RATE A B C [MODEL] < DEFINITION

Subscribes to the NeuroFrames of an acquisition on INPUT, and publishes a NeuroFrame of the shape of a code,
LENGTH values at RATE codes per second, on OUTPUT for each window: frame n has the last step of window
floor((A n - B) / C), unless a frame before it has. With MODEL, the request of offline_torch.py, it filters with scipy and encodes with PyTorch on one
thread. Without MODEL it encodes nothing, so that its times are those of rospy alone. DEFINITION is the full
definition of the message.
"""

import json
import sys

import rospy
from rospy_code import Codes


def main():
    source, topic = sys.argv[1:3]
    length, rate, a, b, c = (int(number) for number in sys.argv[3:8])
    encode = encoder(json.loads(sys.argv[8])) if len(sys.argv) > 8 else None
    codes = Codes("rospy_node", topic, length, rate)
    newest = -1

    def handle(frame):
        nonlocal newest
        # Every frame passes the filters, also those before the first window.
        values = encode(frame) if encode else frame.eeg.data[:length]
        window = (a * frame.neuroheader.seq - b) // c
        if window > newest:
            newest = window
            codes.publish(window + 1, window, values)

    rospy.Subscriber(source, codes.NeuroFrame, handle, queue_size=16, tcp_nodelay=True)
    rospy.spin()


def encoder(request):
    """Returns a function from the next frame to the code of the window that ends with it."""
    import numpy as np
    import torch
    from offline_torch import sections
    from scipy import signal
    from torch_encoder import Encoder, tensors

    torch.set_num_threads(1)
    torch.set_num_interop_threads(1)
    cells, steps = request["cells"], request["steps"]
    network = Encoder(tensors(request["artifact"] + "/weights.safetensors"), cells).eval()
    filters = sections(request)
    state = np.zeros((len(filters), 2, len(cells)))
    planes = np.zeros((steps, request["rows"] * request["columns"]), np.float32)
    shape = (1, steps, request["rows"], request["columns"])

    def encode(frame):
        nonlocal state
        samples = np.asarray(frame.eeg.data).reshape(-1, len(cells))
        # A frame holds a hop, so that each one starts with the sample of a step.
        filtered, state = signal.sosfilt(filters, samples, axis=0, zi=state)
        new = filtered[:: request["decimation"]] / request["sd_uv"]
        planes[: -len(new)] = planes[len(new) :].copy()
        planes[-len(new) :, cells] = new
        with torch.no_grad():
            return network(torch.from_numpy(planes.reshape(shape)))[0].numpy()

    # The first call allocates and chooses kernels.
    with torch.no_grad():
        network(torch.zeros(shape))
    return encode


if __name__ == "__main__":
    main()
