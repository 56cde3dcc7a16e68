"""Streams the samples of a file to the Lab Streaming Layer in real time, as an amplifier does.

Usage: lsl_play.py NAME FILE RATE SAMPLES LABELS UNIT [KEY=VALUE...]. FILE holds float32 values,
sample by sample; LABELS are separated by commas; each chunk has SAMPLES samples. Waits for a
receiver, and prints the time at which the first sample is taken, seconds on the wall clock.

source=ID       source id, by default NAME-1
ppm=P           the amplifier's clock is fast by P parts per million
jitter=S        stamps err by S seconds (standard deviation); they stay in order
omit=FROM:TO    these samples are not sent
restart=INDEX   from this sample on, stamps count from 1 s
"""

import sys
import time

import numpy
import pylsl

name, path, rate, samples, labels, unit = sys.argv[1:7]
options = dict(option.split("=") for option in sys.argv[7:])
rate, samples, labels = int(rate), int(samples), labels.split(",")
values = numpy.fromfile(path, "<f4").reshape(-1, len(labels))
source = options.get("source", f"{name}-1")
info = pylsl.StreamInfo(name, "EEG", len(labels), rate, pylsl.cf_float32, source)
channels = info.desc().append_child("channels")
for label in labels:
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", unit)
    channel.append_child_value("type", "EEG")

count = len(values) // samples * samples
taken = numpy.arange(count) / (rate * (1 + float(options.get("ppm", 0)) * 1e-6))
is_sent = numpy.ones(count, bool)
first, last = map(int, options.get("omit", "0:0").split(":"))
is_sent[first:last] = False
error = numpy.random.default_rng(1).normal(0, float(options.get("jitter", 0)), count)

outlet = pylsl.StreamOutlet(info)
assert outlet.wait_for_consumers(60), "nobody receives the stream"
start = pylsl.local_clock()
print(time.time() - pylsl.local_clock() + start, flush=True)
stamps = numpy.maximum.accumulate(start + taken + error)
restart = int(options.get("restart", count))
if restart < count:
    stamps[restart:] -= stamps[restart] - 1.0
for begin in range(0, count, samples):
    chunk = slice(begin, begin + samples)
    # A chunk is sent when its last sample is taken.
    time.sleep(max(0.0, start + taken[chunk][-1] - pylsl.local_clock()))
    sent = is_sent[chunk]
    if sent.any():
        outlet.push_chunk(values[chunk][sent].tolist(), stamps[chunk][sent].tolist())
print("done", flush=True)
time.sleep(2)
