"""The bridge's work in rospy, timed for comparison by `cargo xtask bench bridge`.

    python3 rospy_bridge.py PORT TOPIC LENGTH RATE < DEFINITION

Reads codes from a TCP port of this machine, each the index of its window (u32) and LENGTH values (float32), RATE
codes per second, and publishes them on TOPIC. DEFINITION is the full definition of the message.
"""

import socket
import struct
import sys

from rospy_code import Codes


def main():
    port, topic = int(sys.argv[1]), sys.argv[2]
    length, rate = (int(number) for number in sys.argv[3:5])
    layout = struct.Struct("<I%df" % length)
    source = socket.create_connection(("127.0.0.1", port))
    codes = Codes("rospy_bridge", topic, length, rate)
    sequence = 0
    while True:
        window, *values = layout.unpack(read(source, layout.size))
        sequence += 1
        codes.publish(sequence, window, values)


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
