"""Calls ROS 2 services as rmw_cyclonedds_cpp does, with Cyclone DDS and without ROS.

    call_cyclone.py DOMAIN NAME=PACKAGE/TYPE...

Calls the services without arguments, one after the other, and prints each response as a line of
JSON: {"topic": NAME, "message": ...}. Ends with status 1 if one is missing or does not answer.

rmw_cyclonedds_cpp puts the number of the client's writer and that of the call before the fields of
request and response. The response has those of its request.
"""

import json
import sys
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from definitions import definition, fields_of, plain

TIMEOUT_S = 30
CALLER, CALL = 0x0123456789ABCDEF, 41
EMPTY = {"structure_needs_at_least_one_member": types.uint8}


def half(service, part, text):
    """Returns the type of a request or response."""
    package, name = service.split("/")
    fields = {"client": types.uint64, "number": types.int64, **(fields_of(text, package) or EMPTY)}
    return make_idl_struct(f"{name}_{part}", f"{package}::srv::dds_::{name}_{part}_", fields)


def wait(what, condition):
    """Returns what `condition` returns, once that is true."""
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        if value := condition():
            return value
        time.sleep(0.01)
    sys.exit(what)


domain, *services = sys.argv[1:]
participant = DomainParticipant(int(domain))
for argument in services:
    service, of = argument.split("=")
    request, response = definition(of.split("/")[0], "srv", of.split("/")[1]).split("---")
    request, response = half(of, "Request", request), half(of, "Response", response)
    qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepAll)
    writer = DataWriter(participant, Topic(participant, f"rq{service}Request", request), qos)
    reader = DataReader(participant, Topic(participant, f"rr{service}Reply", response), qos)
    found = lambda: writer.get_matched_subscriptions() and reader.get_matched_publications()
    wait(f"there is no service {service}", found)
    empty = [0] if "structure_needs_at_least_one_member" in request.__dataclass_fields__ else []
    writer.write(request(CALLER, CALL, *empty))
    answers = lambda: [answer for answer in reader.take(N=10) if answer.sample_info.valid_data]
    (answer,) = wait(f"{service} has not answered", answers)
    if (answer.client, answer.number) != (CALLER, CALL):
        sys.exit(f"{service} has answered call {answer.number} of {answer.client:#x}")
    print(json.dumps({"topic": service, "message": plain(answer)}), flush=True)
