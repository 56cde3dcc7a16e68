"""Subscribes to a stream of the Lab Streaming Layer and takes no sample.

Usage: lsl_subscribe.py NAME. Prints "subscribed". A test then stops this process.
"""

import sys
import time

import pylsl

found = pylsl.resolve_byprop("name", sys.argv[1], timeout=60)
inlet = pylsl.StreamInlet(found[0])
inlet.open_stream(timeout=20)
print("subscribed", flush=True)
time.sleep(600)
