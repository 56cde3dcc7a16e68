"""Streams the samples of a file to the Lab Streaming Layer in real time, as an amplifier does.

Usage: lsl_play.py NAME FILE RATE SAMPLES LABELS UNIT. FILE holds float32 values, sample by sample;
LABELS are separated by commas; each chunk has SAMPLES samples. Waits for a receiver.
"""

import sys
import time

import numpy
import pylsl

name, path, rate, samples, labels, unit = sys.argv[1:]
rate, samples, labels = int(rate), int(samples), labels.split(",")
values = numpy.fromfile(path, "<f4").reshape(-1, len(labels))
info = pylsl.StreamInfo(name, "EEG", len(labels), rate, pylsl.cf_float32, f"{name}-1")
channels = info.desc().append_child("channels")
for label in labels:
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", unit)
    channel.append_child_value("type", "EEG")
outlet = pylsl.StreamOutlet(info)
assert outlet.wait_for_consumers(60), "nobody receives the stream"
start = pylsl.local_clock()
for end in range(samples, len(values) + 1, samples):
    # The time at which the last sample of the chunk is taken.
    due = start + (end - 1) / rate
    time.sleep(max(0.0, due - pylsl.local_clock()))
    outlet.push_chunk(values[end - samples : end].tolist(), due)
print("done", flush=True)
time.sleep(2)
