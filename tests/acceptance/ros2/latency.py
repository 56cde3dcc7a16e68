"""Compares the delays of a bridge's /encoded with those of a publisher of rclpy.

    corticode-bridge --sink ros2 --ros-domain-id DOMAIN ... &
    latency.py DOMAIN SECONDS

One subscriber with Cyclone DDS receives both at the same time: /encoded, and a text of the same
size and rate on /compared. Prints for each topic the delay from publishing to receiving, and the
spread of the intervals when publishing and when receiving, in milliseconds. The spread when
publishing has its cause before DDS. Messages of the first 3 s are left out: what is published
while publisher and subscriber find each other comes seconds late.
"""

import os
import statistics
import subprocess
import sys
import time

RATE_HZ = 16
SIZE = 2400
FOUND_S = 3


def publish():
    """Publishes with rclpy until it is killed."""
    import rclpy
    from std_msgs.msg import String

    rclpy.init()
    node = rclpy.create_node("compared")
    publisher = node.create_publisher(String, "/compared", 1000)
    message = String(data="x" * SIZE)
    node.create_timer(1 / RATE_HZ, lambda: publisher.publish(message))
    rclpy.spin(node)


def receive(domain, seconds):
    """Returns the times of publishing and receiving of each message, in ms, by topic."""
    from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration
    from definitions import struct

    participant = DomainParticipant(domain)
    waits = WaitSet(participant)
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepAll)
    any_state = SampleState.Any | ViewState.Any | InstanceState.Any
    readers = {}
    for name, of in ("/encoded", "ros2neuro_msgs/NeuroFrame"), ("/compared", "std_msgs/String"):
        readers[name] = DataReader(participant, Topic(participant, f"rt{name}", struct(of)), qos)
        waits.attach(ReadCondition(readers[name], any_state))
    times = {name: [] for name in readers}
    first = {}
    end = time.monotonic() + FOUND_S + seconds
    while time.monotonic() < end:
        waits.wait(duration(milliseconds=100))
        # Before `take`, which decodes the samples in Python.
        now = time.time_ns() / 1e6
        for name, reader in readers.items():
            for sample in reader.take(N=1000):
                if sample.sample_info.valid_data and now > first.setdefault(name, now) + FOUND_S * 1e3:
                    times[name].append((sample.sample_info.source_timestamp / 1e6, now))
    return times


def describe(name, times):
    """Prints a line about a topic."""
    if len(times) < 3:
        print(f"{name}: {len(times)} messages")
        return
    delays = sorted(received - published for published, received in times)
    spread = lambda at: statistics.pstdev(b[at] - a[at] for a, b in zip(times, times[1:]))
    print(
        f"{name}: {len(times)} messages; delay: median {statistics.median(delays):.2f}, mean"
        f" {statistics.mean(delays):.2f}, SD {statistics.pstdev(delays):.2f}, 99 %"
        f" {delays[len(delays) * 99 // 100]:.2f}, most {delays[-1]:.2f}; SD of intervals:"
        f" published {spread(0):.2f}, received {spread(1):.2f}"
    )


if sys.argv[1:] == ["--publish"]:
    publish()
else:
    environment = {**os.environ, "ROS_DOMAIN_ID": sys.argv[1]}
    child = subprocess.Popen([sys.executable, __file__, "--publish"], env=environment)
    try:
        for topic, pairs in receive(int(sys.argv[1]), float(sys.argv[2])).items():
            describe(topic, pairs)
    finally:
        child.kill()
