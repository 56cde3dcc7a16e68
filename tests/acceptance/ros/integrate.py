#!/usr/bin/python3
"""An integrator as ROS-Neuro has them: accumulates the evidence of each prediction.

integrate.py TOPIC OUTPUT

Subscribes to the predictions on TOPIC, as rosneuro_integrator does: one probability for each of
decoder.classes. Publishes the exponential mean of them on OUTPUT, and prints a line of JSON for each
message. Prints `{"ready": ...}` once it is linked to a publisher; ends on a signal.
"""

import json
import sys
import threading
import time

import rospy
from rosneuro_msgs.msg import NeuroOutput

ALPHA = 0.9


def main():
    topic, output = sys.argv[1:]
    rospy.init_node("integrator", disable_signals=True)
    publisher = rospy.Publisher(output, NeuroOutput, queue_size=1)
    lock = threading.Lock()
    integrated = []

    def heard(message):
        soft = list(message.softpredict.data)
        if len(soft) != len(message.decoder.classes):
            raise ValueError("%d probabilities of %d classes" % (len(soft), len(message.decoder.classes)))
        if not integrated:
            integrated.extend([1 / len(soft)] * len(soft))
        integrated[:] = [ALPHA * old + (1 - ALPHA) * new for old, new in zip(integrated, soft)]
        line = json.dumps(
            {
                "seq": message.neuroheader.seq,
                "flags": message.header.frame_id,
                "soft": soft,
                "hard": list(message.hardpredict.data),
                "classes": list(message.decoder.classes),
            }
        )
        message.softpredict.data = integrated
        publisher.publish(message)
        with lock:
            print(line, flush=True)

    # A queue, because the test wants every message, on a busy machine too.
    subscriber = rospy.Subscriber(topic, NeuroOutput, heard, queue_size=1000, tcp_nodelay=True)
    while subscriber.get_num_connections() == 0:
        time.sleep(0.01)
    with lock:
        print(json.dumps({"ready": NeuroOutput._md5sum}), flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main()
