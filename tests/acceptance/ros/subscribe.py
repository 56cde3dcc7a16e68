#!/usr/bin/python3
"""A rospy subscriber as somebody else writes it: one line of JSON per message.

subscribe.py TOPIC

The class comes from genpy, so that nothing of our own stands between the wire and the numbers.
rospy sends its MD5 sum, and a publisher of another type refuses it. Prints `{"ready": ...}` once it
is subscribed; ends on a signal.
"""

import json
import sys
import threading

import rospy
from rosneuro_msgs.msg import NeuroFrame


def main():
    topic = sys.argv[1]
    lock = threading.Lock()

    def heard(message):
        line = json.dumps(
            {
                "md5": message._connection_header["md5sum"],
                "type": message._connection_header["type"],
                "header_seq": message.header.seq,
                "stamp": message.header.stamp.to_sec(),
                "seq": message.neuroheader.seq,
                "sr": message.sr,
                "eeg": shape(message.eeg),
                "exg": shape(message.exg),
                "tri": shape(message.tri),
                "status": dict(zip(message.tri.info.labels, message.tri.data)),
                "transducter": message.eeg.info.transducter,
                "values": [round(value, 6) for value in message.eeg.data],
            }
        )
        with lock:
            print(line, flush=True)

    rospy.init_node("listener", anonymous=True, disable_signals=True)
    rospy.Subscriber(topic, NeuroFrame, heard, queue_size=1000, tcp_nodelay=True)
    with lock:
        print(json.dumps({"ready": NeuroFrame._md5sum}), flush=True)
    threading.Event().wait()


def shape(data):
    """What describes a block, and how many numbers it holds."""
    info = data.info
    return {
        "nsamples": info.nsamples,
        "nchannels": info.nchannels,
        "stride": info.stride,
        "isint": info.isint,
        "minmax": list(info.minmax),
        "labels": list(info.labels),
        "count": len(data.data),
    }


if __name__ == "__main__":
    main()
