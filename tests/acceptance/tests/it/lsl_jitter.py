"""Compares when codes arrive from the bridge's outlet and from an outlet of pylsl.

Usage: lsl_jitter.py FOLDER [SECONDS [ROUNDS]], by a Python with pylsl. FOLDER holds the programs
host-sim and corticode-bridge. Nothing runs it but people: times on a busy machine say little.

Each sender has a host-sim in real time, which makes a code every 62.5 ms:

    bridge   host-sim -> TCP -> corticode-bridge --sink lsl
    pylsl    host-sim -> pipe -> a Python that reads a line of JSON and pushes its values

No pseudoterminal, because the kernel passes its bytes on in a thread that waits behind other work.

One receiver takes SECONDS (20) from one sender, then from the other, ROUNDS (6) times. Prints the
standard deviation of the intervals between arrivals, and the delay: how much later a code arrives
than the earliest one of its round would have, on the grid of 62.5 ms.
"""

import json
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
import pylsl

HOP = 0.0625
# Codes that are left out at the start of each round, while the connection settles.
SETTLING = 16


def board(programs, output):
    arguments = ["run", "--quiet", "--realtime", "--input=synthetic", f"--output={output}"]
    return subprocess.Popen([programs / "host-sim", *arguments], stdout=subprocess.PIPE)


def start_bridge(programs, folder, name):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = f"tcp:127.0.0.1:{free.getsockname()[1]}"
    library = Path(pylsl.__file__).parent / "lib/liblsl.so"
    options = ["--sink=lsl", "--streams=codes", f"--port={port}", f"--lsl-name={name}"]
    bridge = [programs / "corticode-bridge", *options, f"--liblsl={library}"]
    environment = os.environ | {"CORTICODE_CONFIG": "/dev/null"}
    log = open(f"{folder}/bridge.log", "w")
    return [board(programs, port), subprocess.Popen(bridge, stderr=log, env=environment)]


def push(programs, name):
    """Sends the codes of a board with an outlet of pylsl. The board ends with its reader."""
    lines = board(programs, "ndjson:-").stdout
    info = pylsl.StreamInfo(name, "Codes", 128, 16, pylsl.cf_float32, name)
    outlet = pylsl.StreamOutlet(info)
    for line in lines:
        line = json.loads(line)
        if line["topic"] == "/encoded":
            outlet.push_sample(line["message"]["eeg"]["data"])


def receive(name, seconds):
    """Returns the times at which codes arrive, seconds."""
    [info] = pylsl.resolve_byprop("name", name, timeout=30)
    inlet = pylsl.StreamInlet(info)
    arrivals = []
    for _ in range(SETTLING + round(seconds / HOP)):
        code, _ = inlet.pull_sample(timeout=10)
        assert code is not None, f"no code from {name}"
        arrivals.append(pylsl.local_clock())
    inlet.close_stream()
    return numpy.array(arrivals[SETTLING:])


def delays(arrivals):
    delay = arrivals - HOP * numpy.arange(len(arrivals))
    return delay - delay.min()


def report(who, rounds):
    intervals = numpy.concatenate([numpy.diff(arrivals) for arrivals in rounds])
    delay = numpy.concatenate([delays(arrivals) for arrivals in rounds])
    rounds = ", ".join(f"{numpy.diff(arrivals).std() * 1e3:.3f}" for arrivals in rounds)
    median, p99 = numpy.percentile(delay, [50, 99]) * 1e3
    print(
        f"{who}: {len(intervals)} intervals, mean {intervals.mean() * 1e3:.3f} ms, "
        f"SD {intervals.std() * 1e3:.3f} ms (rounds {rounds}); "
        f"delay median {median:.3f} ms, p99 {p99:.3f} ms, largest {delay.max() * 1e3:.3f} ms"
    )


def main():
    programs = Path(sys.argv[1])
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 20.0
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 6
    names = [f"jitter{os.getpid()}", f"peer{os.getpid()}"]
    with tempfile.TemporaryDirectory() as folder:
        started = start_bridge(programs, folder, names[0])
        sender = multiprocessing.Process(target=push, args=(programs, names[1]), daemon=True)
        sender.start()
        started.append(sender)
        try:
            print("load", os.getloadavg()[0])
            arrivals = {who: [] for who in (f"{names[0]}-codes", names[1])}
            for _ in range(rounds):
                for name, of in arrivals.items():
                    of.append(receive(name, seconds))
            print("load", os.getloadavg()[0])
            for who, of in zip(("bridge", "pylsl"), arrivals.values()):
                report(who, of)
        finally:
            for process in started:
                process.terminate()


main()
