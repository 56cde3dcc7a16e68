"""Records all streams of one bridge as LabRecorder does, and reads the file back with pyxdf.

Usage: lsl_record.py FOLDER NAME STREAM... Waits for the streams NAME-STREAM, prints "ready" when
it receives all, and records until they have ended. Writes to FOLDER:

* recorded.xdf, by the specification of XDF 1.0;
* STREAM.f32 and STREAM.f64: values and times of regular streams, as they came;
* recorded.json: metadata and markers, what pyxdf reads, and the wall clock's offset.
"""

import json
import struct
import sys
import threading
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy
import pylsl
import pyxdf

FORMATS = {pylsl.cf_float32: "float32", pylsl.cf_string: "string"}


class Recording:
    """A stream that is received in a thread of its own."""

    def __init__(self, info):
        self.inlet = pylsl.StreamInlet(info, max_buflen=360, recover=False)
        self.info = self.inlet.info(timeout=20)
        self.values, self.times, self.corrections = [], [], []
        self.least_delay = float("inf")
        self.inlet.open_stream(timeout=20)
        self.correct()
        self.thread = threading.Thread(target=self.run)

    def correct(self):
        try:
            offset = self.inlet.time_correction(timeout=5)
            self.corrections.append((pylsl.local_clock(), offset))
        except Exception as error:  # The stream has just ended.
            print(error, file=sys.stderr)

    def run(self):
        corrected = time.monotonic()
        try:
            while True:
                values, times = self.inlet.pull_chunk(timeout=0.2, max_samples=4096)
                if times:
                    delay = pylsl.local_clock() - times[-1]
                    self.least_delay = min(self.least_delay, delay)
                self.values += values
                self.times += times
                if time.monotonic() - corrected > 2:
                    self.correct()
                    corrected = time.monotonic()
        except pylsl.util.LostError:
            pass

    def is_text(self):
        return self.info.channel_format() == pylsl.cf_string


def length(number):
    return struct.pack("<BI", 4, number)


def chunk(tag, content):
    return length(len(content) + 2) + struct.pack("<H", tag) + content


def sample(recording, value, stamp):
    if recording.is_text():
        value = b"".join(length(len(text.encode())) + text.encode() for text in value)
    else:
        value = numpy.asarray(value, "<f4").tobytes()
    return struct.pack("<Bd", 8, stamp) + value


def write_xdf(path, recordings):
    with open(path, "wb") as file:
        file.write(b"XDF:")
        file.write(chunk(1, b'<?xml version="1.0"?><info><version>1.0</version></info>'))
        for number, recording in enumerate(recordings, 1):
            number = struct.pack("<I", number)
            file.write(chunk(2, number + recording.info.as_xml().encode()))
            for at, offset in recording.corrections:
                file.write(chunk(4, number + struct.pack("<dd", at - offset, offset)))
            samples = zip(recording.values, recording.times)
            samples = b"".join(sample(recording, *of) for of in samples)
            file.write(chunk(3, number + length(len(recording.times)) + samples))
            times = recording.times or [0]
            footer = (
                f"<info><first_timestamp>{times[0]}</first_timestamp>"
                f"<last_timestamp>{times[-1]}</last_timestamp>"
                f"<sample_count>{len(recording.times)}</sample_count></info>"
            )
            file.write(chunk(6, number + footer.encode()))


def described(recording):
    info = recording.info
    root = ET.fromstring(info.as_xml())
    channels = [
        {
            child.tag: {axis.tag: float(axis.text) for axis in child} if len(child) else child.text
            for child in one
        }
        for one in root.findall("desc/channels/channel")
    ]
    text = lambda path: root.findtext(path)
    return {
        "name": info.name(),
        "type": info.type(),
        "host": info.hostname(),
        "source_id": info.source_id(),
        "rate": info.nominal_srate(),
        "format": FORMATS[info.channel_format()],
        "channels": channels,
        "serial": text("desc/acquisition/serial_number"),
        "model": text("desc/acquisition/model"),
        "lag_s": float(text("desc/acquisition/compensated_lag")),
        "drops": text("desc/synchronization/can_drop_samples"),
        "corrections": [offset for _, offset in recording.corrections],
        "least_delay_s": recording.least_delay if recording.times else None,
        "markers": [
            [stamp, value[0]] for stamp, value in zip(recording.times, recording.values)
        ] if recording.is_text() else [],
    }


def wall_minus_lsl():
    """The wall clock's time minus liblsl's, seconds; the reading that took the least time."""
    def reading():
        before = pylsl.local_clock()
        wall = time.time()
        after = pylsl.local_clock()
        return after - before, wall - (before + after) / 2
    return min(reading() for _ in range(100))[1]


def read_back(path):
    streams, _ = pyxdf.load_xdf(str(path))
    result = {}
    for stream in streams:
        info, stamps = stream["info"], stream["time_stamps"]
        is_text = info["channel_format"][0] == "string"
        result[info["name"][0]] = {
            "samples": len(stamps),
            "rate": float(info["effective_srate"]),
            "times": [float(stamp) for stamp in stamps],
            "texts": [row[0] for row in stream["time_series"]] if is_text else [],
            "segments": len(info["segments"]),
        }
    return result


def main():
    folder, name, streams = Path(sys.argv[1]), sys.argv[2], sys.argv[3:]
    recordings = []
    for stream in streams:
        found = pylsl.resolve_byprop("name", f"{name}-{stream}", timeout=60)
        assert len(found) == 1, (stream, found)
        recordings.append(Recording(found[0]))
    for recording in recordings:
        recording.thread.start()
    print("ready", flush=True)
    for recording in recordings:
        recording.thread.join()
    path = folder / "recorded.xdf"
    write_xdf(path, recordings)
    for stream, recording in zip(streams, recordings):
        if not recording.is_text():
            numpy.asarray(recording.values, "<f4").tofile(folder / f"{stream}.f32")
            numpy.asarray(recording.times, "<f8").tofile(folder / f"{stream}.f64")
    result = {
        "streams": {stream: described(of) for stream, of in zip(streams, recordings)},
        "xdf": read_back(path),
        "wall_minus_lsl": wall_minus_lsl(),
    }
    (folder / "recorded.json").write_text(json.dumps(result))


main()
