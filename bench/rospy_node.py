"""The paper's node in rospy, timed for comparison by `cargo xtask bench node`.

    python3 rospy_node.py INPUT OUTPUT FIRST LENGTH RATE < DEFINITION

Subscribes to the NeuroFrames of an acquisition on INPUT, and publishes a NeuroFrame of the shape of a code,
LENGTH values at RATE codes per second, on OUTPUT for each frame from number FIRST on: the windows that these
frames complete. It filters and encodes nothing, so that its times are those of rospy alone; a node that does would be slower. DEFINITION is
the full definition of the message. The publisher is the fastest that rospy has: it writes the socket itself,
without a queue and without Nagle's algorithm.
"""

import sys
import warnings

import rospy
from genpy.dynamic import generate_dynamic

WORDS = ["flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2", "lost", "trigger"]


def main():
    source, topic = sys.argv[1:3]
    first, length, rate = (int(number) for number in sys.argv[3:6])
    NeuroFrame = generate_dynamic("rosneuro_msgs/NeuroFrame", sys.stdin.read())["rosneuro_msgs/NeuroFrame"]
    rospy.init_node("rospy_node", disable_signals=True)
    # rospy warns of a publisher without a queue, because a slow subscriber delays it.
    warnings.simplefilter("ignore", SyntaxWarning)
    publisher = rospy.Publisher(topic, NeuroFrame, queue_size=None, tcp_nodelay=True)
    code = NeuroFrame()
    code.sr = rate
    describe(code.eeg.info, ["z%03d" % index for index in range(length)])
    describe(code.tri.info, WORDS)

    def handle(frame):
        window = frame.neuroheader.seq - first
        if window < 0:
            return
        code.header.stamp = rospy.Time.now()
        code.neuroheader.seq = window + 1
        code.eeg.data = frame.eeg.data[:length]
        code.tri.data = [0, window & 0xFFFF, window >> 16, 0, 0, 0, 0, 0]
        publisher.publish(code)

    rospy.Subscriber(source, NeuroFrame, handle, queue_size=16, tcp_nodelay=True)
    rospy.spin()


def describe(info, labels):
    info.nsamples, info.nchannels, info.stride = 1, len(labels), 4 * len(labels)
    info.labels = labels
    info.minmax = [-1.0, 1.0]


if __name__ == "__main__":
    main()
