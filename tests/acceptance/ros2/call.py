"""Calls services of the type std_srvs/Empty with rclpy.

    call.py NAME...

Waits for each service, calls it, and prints its name once it has answered. Ends with status 1 if
one does not answer in time.
"""

import sys

import rclpy
from std_srvs.srv import Empty

TIMEOUT = 30

rclpy.init()
node = rclpy.create_node("caller")
for name in sys.argv[1:]:
    client = node.create_client(Empty, name)
    if not client.wait_for_service(TIMEOUT):
        sys.exit(f"there is no service {name}")
    future = client.call_async(Empty.Request())
    rclpy.spin_until_future_complete(node, future, timeout_sec=TIMEOUT)
    if future.result() is None:
        sys.exit(f"{name} has not answered")
    print(name, flush=True)
