"""Records one topic of the bridge's JSON lines to a GDF file, as rosneuro_recorder records a ROS topic.

The file is written by libxdffileio, the library of rosneuro_recorder, with the settings that it uses. It
takes for the time of its first sample the arrival of the first frame minus the frame's duration, writes
every frame as it arrives, and places an event by its stamp relative to that time.

Arguments: the topic and the name of the file. Standard input: JSON lines. An end of the input ends the
recording.
"""

import ctypes
import json
import sys
import time

# Values of the enumerations in libxdffileio's header xdfio.h.
WRITE, GDF2 = 0, 5
INT32, FLOAT = 6, 8
END = 0
REC_DURATION, REC_NSAMPLE = 1, 2
ARRAY_INDEX, ARRAY_OFFSET, ARRAY_DIGITAL, ARRAY_TYPE, STORED_TYPE = range(10001, 10006)
PHYSICAL_MIN, PHYSICAL_MAX = 10007, 10008
UNIT, TRANSDUCTER, PREFILTERING = range(20000, 20003)

integer, double, text = ctypes.c_int, ctypes.c_double, ctypes.c_char_p


class Gdf:
    """A GDF file of the blocks eeg, exg and tri."""

    def __init__(self, path, frame):
        self.library = ctypes.CDLL("libxdffileio.so.0")
        self.library.xdf_open.restype = ctypes.c_void_p
        self.library.xdf_add_channel.restype = ctypes.c_void_p
        self.file = ctypes.c_void_p(self.library.xdf_open(path.encode(), WRITE, GDF2))
        self.configure((REC_DURATION, double(1.0)), (REC_NSAMPLE, integer(frame["sr"])))
        self.blocks = [frame[name]["info"] for name in ("eeg", "exg", "tri")]
        for index, info in enumerate(self.blocks):
            self.add_block(index, info)
        strides = (ctypes.c_size_t * 3)(*(4 * info["nchannels"] for info in self.blocks))
        self.check(self.library.xdf_define_arrays(self.file, 3, strides))
        self.check(self.library.xdf_prepare_transfer(self.file))

    def check(self, result):
        if result < 0:
            raise OSError("libxdffileio refuses a call")
        return result

    def configure(self, *fields):
        arguments = [part for field, value in fields for part in (integer(field), value)]
        self.check(self.library.xdf_set_conf(self.file, *arguments, integer(END)))

    def add_block(self, index, info):
        stored = self.library.xdf_closest_type(self.file, FLOAT)
        self.configure(
            (ARRAY_INDEX, integer(index)),
            (ARRAY_OFFSET, integer(0)),
            (ARRAY_DIGITAL, integer(0)),
            (ARRAY_TYPE, integer(INT32 if info["isint"] else FLOAT)),
            (STORED_TYPE, integer(stored)),
            (PHYSICAL_MIN, double(info["minmax"][0])),
            (PHYSICAL_MAX, double(info["minmax"][1])),
            (TRANSDUCTER, text(info["transducter"].encode())),
            (PREFILTERING, text(info["prefiltering"].encode())),
            (UNIT, text(info["unit"].encode())),
        )
        for label in info["labels"]:
            if not self.library.xdf_add_channel(self.file, label.encode()):
                raise OSError("libxdffileio refuses a channel")

    def write(self, frame):
        kinds = [ctypes.c_int32 if info["isint"] else ctypes.c_float for info in self.blocks]
        data = [frame[name]["data"] for name in ("eeg", "exg", "tri")]
        arrays = [(kind * max(len(values), 1))(*values) for kind, values in zip(kinds, data)]
        samples = self.blocks[0]["nsamples"]
        self.check(self.library.xdf_write(self.file, ctypes.c_size_t(samples), *arrays))

    def add_event(self, code, onset_s, duration_s):
        kind = self.check(self.library.xdf_add_evttype(self.file, code, None))
        result = self.library.xdf_add_event(self.file, kind, double(onset_s), double(duration_s))
        self.check(result)

    def close(self):
        self.check(self.library.xdf_close(self.file))


def main():
    topic, path = sys.argv[1:]
    gdf, start = None, 0.0
    for line in sys.stdin:
        line = json.loads(line)
        message = line["message"]
        if line["topic"] == topic:
            if gdf is None:
                gdf = Gdf(path, message)
                start = time.time() - message["eeg"]["info"]["nsamples"] / message["sr"]
            gdf.write(message)
        elif line["topic"] == "/events/bus" and gdf is not None:
            stamp = message["header"]["stamp"]
            onset = stamp["secs"] + stamp["nsecs"] * 1e-9 - start
            gdf.add_event(message["event"], onset, message["duration"])
    if gdf is not None:
        gdf.close()


main()
