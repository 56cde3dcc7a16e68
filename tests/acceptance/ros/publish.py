#!/usr/bin/python3
"""A rospy acquisition as somebody else writes it: publishes the samples of a file as NeuroFrames.

publish.py TOPIC FILE RATE SAMPLES LABELS SPEED

FILE holds float32 values, sample by sample; LABELS are separated by commas; SPEED is a multiple of real
time. Waits for a subscriber, then publishes all whole frames, numbered from 1.
"""

import sys
import time
from array import array

import rospy
from rosneuro_msgs.msg import NeuroFrame


def main():
    topic, path, rate, samples, labels, speed = sys.argv[1:]
    rate, samples, labels, speed = int(rate), int(samples), labels.split(","), float(speed)
    with open(path, "rb") as file:
        values = array("f", file.read())
    rospy.init_node("amplifier", disable_signals=True)
    publisher = rospy.Publisher(topic, NeuroFrame, queue_size=1000, tcp_nodelay=True)
    frame = NeuroFrame()
    frame.sr = rate
    info = frame.eeg.info
    info.nsamples, info.nchannels, info.stride = samples, len(labels), 4 * len(labels)
    info.unit, info.labels, info.minmax = "uV", labels, [-187500.0, 187500.0]
    while publisher.get_num_connections() == 0:
        time.sleep(0.05)
    print("connected", flush=True)
    size = samples * len(labels)
    period = samples / rate / speed
    start = time.monotonic()
    for index in range(len(values) // size):
        time.sleep(max(0.0, start + index * period - time.monotonic()))
        frame.header.stamp = rospy.Time.now()
        frame.neuroheader.seq = index + 1
        frame.eeg.data = values[index * size : (index + 1) * size].tolist()
        publisher.publish(frame)
    print("done", flush=True)
    time.sleep(1)
    rospy.signal_shutdown("all frames are published")


if __name__ == "__main__":
    main()
