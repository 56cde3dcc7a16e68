"""The codes that the nodes in rospy publish: NeuroFrames of the shape and size of the bridge's.

The publisher is the fastest that rospy has: it writes the socket itself, without a queue and without Nagle's
algorithm.
"""

import sys
import warnings

import rospy
from genpy.dynamic import generate_dynamic

WORDS = ["flags", "seq_lo", "seq_hi", "t_us_0", "t_us_1", "t_us_2", "lost", "trigger"]


class Codes:
    """A node that publishes codes of `length` values, `rate` per second, on `topic`.

    Standard input has the full definition of the message.
    """

    def __init__(self, node, topic, length, rate):
        name = "rosneuro_msgs/NeuroFrame"
        self.NeuroFrame = generate_dynamic(name, sys.stdin.read())[name]
        rospy.init_node(node, disable_signals=True)
        # rospy warns of a publisher without a queue, because a slow subscriber delays it.
        warnings.simplefilter("ignore", SyntaxWarning)
        self.publisher = rospy.Publisher(topic, self.NeuroFrame, queue_size=None, tcp_nodelay=True)
        self.frame = self.NeuroFrame()
        self.frame.sr = rate
        describe(self.frame.eeg.info, ["z%03d" % index for index in range(length)])
        describe(self.frame.tri.info, WORDS)

    def publish(self, sequence, window, values):
        self.frame.header.stamp = rospy.Time.now()
        self.frame.neuroheader.seq = sequence
        self.frame.eeg.data = values
        self.frame.tri.data = [0, window & 0xFFFF, window >> 16, 0, 0, 0, 0, 0]
        self.publisher.publish(self.frame)


def describe(info, labels):
    info.nsamples, info.nchannels, info.stride = 1, len(labels), 4 * len(labels)
    info.labels = labels
    info.minmax = [-1.0, 1.0]
