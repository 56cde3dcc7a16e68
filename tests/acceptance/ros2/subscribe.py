"""Subscribes to ROS 2 topics with Cyclone DDS, without ROS, and prints each message as JSON.

    subscribe.py [--latched] DOMAIN TOPIC=PACKAGE/TYPE...

The types are made from the message definitions: ROS 2-Neuro's from `ros/ros2/`, others from the
installed Python packages of ROS 2. A line is {"topic": ..., "message": ...} with the fields of the
definition. Ends at SIGTERM, after what has arrived is printed.
"""

import json
import signal
import sys
import threading
from pathlib import Path

from cyclonedds.core import ReadCondition, SampleState, ViewState, InstanceState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

OURS = Path(__file__).parents[3] / "ros" / "ros2"
INSTALLED = Path(sys.prefix) / "share"
NUMBERS = {
    name: getattr(types, name)
    for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")
}
SIMPLE = {**NUMBERS, "string": str, "bool": bool, "byte": types.uint8}
made = {}


def type_of(name, package):
    """Returns the type that a field of `package` calls `name`."""
    if name.endswith("[]"):
        return types.sequence[type_of(name[:-2], package)]
    if name in SIMPLE:
        return SIMPLE[name]
    return struct(name if "/" in name else f"{package}/{name}")


def struct(name):
    """Returns the type PACKAGE/TYPE."""
    if name not in made:
        package, short = name.split("/")
        folder = OURS if (OURS / package).is_dir() else INSTALLED
        text = (folder / package / "msg" / f"{short}.msg").read_text()
        lines = (line.split("#")[0].split() for line in text.splitlines())
        fields = {words[1]: type_of(words[0], package) for words in lines if words and "=" not in words[1]}
        made[name] = make_idl_struct(short, f"{package}::msg::dds_::{short}_", fields)
    return made[name]


def plain(value):
    """Returns the value with structures as dictionaries."""
    if hasattr(value, "__idl__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


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
