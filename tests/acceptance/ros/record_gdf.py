#!/usr/bin/python3
"""Records a topic of NeuroFrames and the events on /events/bus to a GDF file, as rosneuro_recorder does.

It subscribes to both, calls /acquisition/get_info until the call succeeds, and takes every later frame. A
recorder handles its first frame at once; while many programs start on a busy machine, this one does not, so
it waits until frames are handled promptly, and calls again if the first one was not. It takes for the time of its first sample the arrival of the first frame minus the frame's duration, and places
an event by its stamp relative to that time. The file is written by libxdffileio, the library of
rosneuro_recorder, with the settings that it uses.

Arguments: the topic and the name of the file. Prints `recording` at the first frame; SIGTERM ends the
recording.
"""

import ctypes
import faulthandler
import os
import signal
import sys
import threading
import time

import rospy
from rosneuro_msgs.msg import NeuroEvent, NeuroFrame
from rosneuro_msgs.srv import GetAcquisitionInfo

# Values of the enumerations in libxdffileio's header xdfio.h.
WRITE, GDF2 = 0, 5
INT32, FLOAT = 6, 8
END = 0
REC_DURATION, REC_NSAMPLE = 1, 2
ARRAY_INDEX, ARRAY_OFFSET, ARRAY_DIGITAL, ARRAY_TYPE, STORED_TYPE = range(10001, 10006)
PHYSICAL_MIN, PHYSICAL_MAX = 10007, 10008
UNIT, TRANSDUCTER, PREFILTERING = range(20000, 20003)

# Age above which a frame was not handled promptly, seconds after its last sample.
LATE = 0.02
# Number of consecutive frames after which the machine counts as idle enough.
PROMPT_FRAMES = 16
# Time after the signal at which every thread's stack is printed, if the recording is not closed by then, seconds.
HANGS = 30

integer, double, text = ctypes.c_int, ctypes.c_double, ctypes.c_char_p


class Gdf:
    """A GDF file of the blocks eeg, exg and tri."""

    def __init__(self, path, frame):
        self.library = ctypes.CDLL("libxdffileio.so.0")
        self.library.xdf_open.restype = ctypes.c_void_p
        self.library.xdf_add_channel.restype = ctypes.c_void_p
        self.file = ctypes.c_void_p(self.library.xdf_open(path.encode(), WRITE, GDF2))
        self.configure((REC_DURATION, double(1.0)), (REC_NSAMPLE, integer(frame.sr)))
        self.blocks = [block.info for block in (frame.eeg, frame.exg, frame.tri)]
        for index, info in enumerate(self.blocks):
            self.add_block(index, info)
        strides = (ctypes.c_size_t * 3)(*(4 * info.nchannels for info in self.blocks))
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
            (ARRAY_TYPE, integer(INT32 if info.isint else FLOAT)),
            (STORED_TYPE, integer(stored)),
            (PHYSICAL_MIN, double(info.minmax[0])),
            (PHYSICAL_MAX, double(info.minmax[1])),
            (TRANSDUCTER, text(info.transducter.encode())),
            (PREFILTERING, text(info.prefiltering.encode())),
            (UNIT, text(info.unit.encode())),
        )
        for label in info.labels:
            if not self.library.xdf_add_channel(self.file, label.encode()):
                raise OSError("libxdffileio refuses a channel")

    def write(self, frame):
        kinds = [ctypes.c_int32 if info.isint else ctypes.c_float for info in self.blocks]
        data = [block.data for block in (frame.eeg, frame.exg, frame.tri)]
        arrays = [(kind * max(len(values), 1))(*values) for kind, values in zip(kinds, data)]
        samples = self.blocks[0].nsamples
        self.check(self.library.xdf_write(self.file, ctypes.c_size_t(samples), *arrays))

    def add_event(self, code, onset_s, duration_s):
        kind = self.check(self.library.xdf_add_evttype(self.file, code, None))
        result = self.library.xdf_add_event(self.file, kind, double(onset_s), double(duration_s))
        self.check(result)

    def close(self):
        self.check(self.library.xdf_close(self.file))


class Recorder:
    """Takes frames and events from the call of get_info on."""

    def __init__(self, path):
        self.path = path
        self.gdf, self.start = None, None
        self.is_ready, self.prompt = False, 0
        self.lock = threading.Lock()

    def prepare(self, frame):
        with self.lock:
            self.gdf = self.gdf or Gdf(self.path, frame)
            self.is_ready = True

    def take_frame(self, frame):
        now, duration = time.time(), frame.eeg.info.nsamples / frame.sr
        is_late = now - frame.header.stamp.to_sec() - duration > LATE
        with self.lock:
            self.prompt = 0 if is_late else self.prompt + 1
            if self.start is None and is_late:
                self.is_ready = False
            if not self.is_ready:
                return
            if self.start is None:
                self.start = now - duration
                print("recording", flush=True)
            self.gdf.write(frame)

    def take_event(self, event):
        with self.lock:
            if self.start is not None:
                onset = event.header.stamp.to_sec() - self.start
                self.gdf.add_event(event.event, onset, event.duration)


def main():
    topic, path = sys.argv[1:]
    # No thread handles the signal, so that it cannot be delivered to another thread than the one that waits for it.
    signals = {signal.SIGTERM}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    rospy.init_node("recorder", disable_signals=True)
    recorder = Recorder(path)
    options = {"queue_size": 1000, "tcp_nodelay": True}
    rospy.Subscriber(topic, NeuroFrame, recorder.take_frame, **options)
    rospy.Subscriber("/events/bus", NeuroEvent, recorder.take_event, **options)
    service = "/acquisition/get_info"
    rospy.wait_for_service(service)
    call = rospy.ServiceProxy(service, GetAcquisitionInfo)
    ended = None
    while recorder.start is None and not ended:
        ended = signal.sigtimedwait(signals, 0.05)
        if recorder.is_ready or recorder.prompt < PROMPT_FRAMES:
            continue
        try:
            recorder.prepare(call().frame)
        except rospy.ServiceException:
            pass
    if not ended:
        signal.sigwait(signals)
    faulthandler.dump_traceback_later(HANGS)
    with recorder.lock:
        recorder.gdf.close()
    # Without waiting for rospy's threads: one that connects again to a bridge that has gone sleeps for up to a
    # minute.
    sys.stdout.flush()
    os._exit(0)


main()
