"""Finds the streams of the Lab Streaming Layer whose names start with NAME.

Usage: lsl_find.py NAME COUNT. Waits for COUNT streams, and prints each as a line of JSON.
"""

import json
import sys

import pylsl

name, count = sys.argv[1], int(sys.argv[2])
for info in pylsl.resolve_bypred(f"starts-with(name,'{name}')", minimum=count, timeout=60):
    stream = {
        "name": info.name(),
        "host": info.hostname(),
        "source_id": info.source_id(),
        "channels": info.channel_count(),
    }
    print(json.dumps(stream), flush=True)
