"""The bridge's work in rospy, timed for comparison by `cargo xtask bench bridge`.

    python3 rospy_bridge.py PORT TOPIC LENGTH RATE < DEFINITION

Reads codes from a TCP port of this machine, each the index of its window (u32) and LENGTH values (float32), RATE
codes per second, and publishes them as NeuroFrames of the shape and size of the bridge's. DEFINITION is the full definition of the
message. The publisher is the fastest that rospy has: it writes the socket itself, without a queue and without
Nagle's algorithm.
"""

import socket
import struct
import sys
import warnings

import rospy
from genpy.dynamic import generate_dynamic

WORDS = ["flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2", "lost", "trigger"]


def main():
    port, topic = int(sys.argv[1]), sys.argv[2]
    length, rate = (int(number) for number in sys.argv[3:5])
    layout = struct.Struct("<I%df" % length)
    NeuroFrame = generate_dynamic("rosneuro_msgs/NeuroFrame", sys.stdin.read())["rosneuro_msgs/NeuroFrame"]
    source = socket.create_connection(("127.0.0.1", port))
    rospy.init_node("rospy_bridge", disable_signals=True)
    # rospy warns of a publisher without a queue, because a slow subscriber delays it.
    warnings.simplefilter("ignore", SyntaxWarning)
    publisher = rospy.Publisher(topic, NeuroFrame, queue_size=None, tcp_nodelay=True)
    frame = NeuroFrame()
    frame.sr = rate
    describe(frame.eeg.info, ["z%03d" % index for index in range(length)])
    describe(frame.tri.info, WORDS)
    sequence = 0
    while True:
        window, *frame.eeg.data = layout.unpack(read(source, layout.size))
        sequence += 1
        frame.header.stamp = rospy.Time.now()
        frame.neuroheader.seq = sequence
        frame.tri.data = [0, window & 0xFFFF, window >> 16, 0, 0, 0, 0, 0]
        publisher.publish(frame)


def describe(info, labels):
    info.nsamples, info.nchannels, info.stride = 1, len(labels), 4 * len(labels)
    info.labels = labels
    info.minmax = [-1.0, 1.0]


def read(source, size):
    data = b""
    while len(data) < size:
        more = source.recv(size - len(data))
        if not more:
            sys.exit(0)
        data += more
    return data


if __name__ == "__main__":
    main()
