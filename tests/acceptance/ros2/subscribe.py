"""Subscribes to ROS 2 topics with Cyclone DDS, without ROS, and prints each message as JSON.

    subscribe.py [--latched] DOMAIN TOPIC=PACKAGE/TYPE...

A line is {"topic": ..., "message": ...} with the fields of the
definition. Ends at SIGTERM, after what has arrived is printed.
"""

import json
import signal
import sys
import threading

from cyclonedds.core import ReadCondition, SampleState, ViewState, InstanceState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from definitions import plain, struct

def main():
    """Prints the messages of the topics until SIGTERM."""
    arguments = sys.argv[1:]
    latched = arguments[0] == "--latched"
    domain, *topics = arguments[latched:]
    participant = DomainParticipant(int(domain))
    policies = [Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepAll]
    if latched:
        policies.append(Policy.Durability.TransientLocal)
    waits = WaitSet(participant)
    readers = []
    for argument in topics:
        name, of = argument.split("=")
        reader = DataReader(participant, Topic(participant, f"rt{name}", struct(of)), Qos(*policies))
        any_state = SampleState.Any | ViewState.Any | InstanceState.Any
        waits.attach(ReadCondition(reader, any_state))
        readers.append((name, reader))
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    is_last = False
    while not is_last:
        is_last = ended.is_set()
        waits.wait(duration(milliseconds=50))
        for name, reader in readers:
            for sample in reader.take(N=1000):
                # A publisher that leaves makes a sample without data.
                if sample.sample_info.valid_data:
                    print(json.dumps({"topic": name, "message": plain(sample)}), flush=True)


main()
