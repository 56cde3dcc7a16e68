//! Makes recordings in virtual time, with a simulated board, the core and the recorder.

use bridge_core::{Core, Effects, FillerPolicy, HostTime, Settings};
use capture::{FileHeader, Recorder};
use link::{CodeValues, Event, EventKind, Filtered, Flags, Raw, Streams, ToHost};

use crate::board::{Board, at};

/// Ticks per second of the host's clock. In channel 0, the board sends the time of each sample in
/// ticks, which identifies the sample even after a restart.
pub(crate) const TICKS_PER_SECOND: i64 = 512;
/// Delay of the simulated board's filters, microseconds, as [`Board`] reports it.
pub(crate) const FILTER_DELAY_US: i64 = 10_000;
/// Time from one code to the next, microseconds.
const HOP_US: i64 = 62_500;

/// A simulated board, the core and a recorder, with which a test makes a recording step by step.
pub(crate) struct Rig {
    board: Board,
    core: Core,
    port: Port,
    /// Present host time, microseconds.
    now_us: i64,
    /// Host time at which the board started, microseconds.
    boot_us: i64,
    /// Host time of the first ADC sample after the board's start, microseconds.
    start_us: i64,
    streams: Streams,
    /// Device time that passes per unit of host time: 1 for a real board, more for a simulated one.
    speed: i64,
    random: u64,
    loss_percent: u64,
    events: u32,
    /// Host times of all edges of the trigger input, microseconds.
    pub(crate) event_times_us: Vec<i64>,
    /// Number of frames that were lost on the way to the recorder.
    pub(crate) lost: u32,
}

struct Port {
    recorder: Recorder,
    outgoing: Vec<u8>,
    now: HostTime,
}

impl Effects for Port {
    fn send(&mut self, frame: &[u8]) {
        self.recorder.sent(frame, self.now);
        self.outgoing.extend_from_slice(frame);
    }
}

impl Rig {
    pub(crate) fn new(loss_percent: u64) -> Rig {
        let streams = Streams::CODES | Streams::RAW | Streams::FILTERED | Streams::EVENTS;
        Rig::with(streams, 1, loss_percent)
    }

    /// Starts to record a board that sends `streams` and whose time is `speed` times as fast as the
    /// host's.
    pub(crate) fn with(streams: Streams, speed: i64, loss_percent: u64) -> Rig {
        let settings =
            Settings { mains_hz: 50, filler: FillerPolicy::Off, streams, ..Settings::default() };
        let header = FileHeader { created_ns: at(0).wall_ns, streams, mains_hz: 50 };
        let mut rig = Rig {
            board: Board::new(),
            core: Core::new(settings, None),
            port: Port { recorder: Recorder::new(header), outgoing: Vec::new(), now: at(0) },
            now_us: 1_000_000,
            boot_us: -3_000_000,
            start_us: 0,
            streams,
            speed,
            random: 88_172_645_463_325_252,
            loss_percent,
            events: 0,
            event_times_us: Vec::new(),
            lost: 0,
        };
        let opened = rig.host_time(rig.now_us);
        rig.port.recorder.opened(opened);
        rig.core.connected(opened, &mut rig.port);
        rig.handshake();
        rig
    }

    /// Exchanges commands and answers until the board streams.
    fn handshake(&mut self) {
        while !self.board.streaming || !self.port.outgoing.is_empty() {
            self.now_us += 1_000;
            let commands = std::mem::take(&mut self.port.outgoing);
            let answers = self.board.answer(&commands);
            self.receive(&answers, self.now_us);
        }
        self.start_us = self.now_us;
    }

    fn receive(&mut self, bytes: &[u8], read_us: i64) {
        let read = self.host_time(read_us);
        self.port.now = read;
        self.port.recorder.received(bytes, read);
        self.core.receive(bytes, read, &mut self.port);
    }

    /// Returns the host's time after `us` microseconds of device time.
    fn host_time(&self, us: i64) -> HostTime {
        at(us / self.speed)
    }

    /// Restarts the board after `outage_us` microseconds; its clock and indices start again.
    pub(crate) fn restart(&mut self, outage_us: i64) {
        self.board.reboot();
        self.boot_us = self.now_us + outage_us;
        self.now_us = self.boot_us + 5_000;
        self.events = 0;
        let hello = self.board.hello();
        self.receive(&hello, self.now_us);
        self.handshake();
    }

    fn next_random(&mut self) -> u64 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        self.random
    }

    /// Sends a message of the board, which arrives up to 9 ms later or is lost on the way.
    fn send(&mut self, host_us: i64, message: &ToHost) {
        let device_us = u64::try_from(host_us - self.boot_us).unwrap();
        let frame = self.board.frame(device_us, message);
        let delay_us = (self.next_random() % 9_000).cast_signed();
        self.deliver(&frame, host_us + delay_us);
    }

    /// Delivers a frame, or, with the probability `loss_percent`, loses it on the way.
    fn deliver(&mut self, frame: &[u8], read_us: i64) {
        if self.next_random() % 100 < self.loss_percent {
            self.lost += 1;
        } else {
            self.receive(frame, read_us);
        }
    }

    /// Returns the host time, microseconds, of the ADC sample with the index `sample`, which counts
    /// from the board's start.
    fn sample_us(&self, sample: i64) -> i64 {
        self.start_us + sample * 1_000_000 / TICKS_PER_SECOND
    }

    /// Runs the board for `hops` hops. An edge of the trigger input happens in every
    /// `event_every`-th hop, and its message arrives up to two hops later.
    pub(crate) fn run(&mut self, hops: u32, event_every: u32) {
        let mut late: Option<(i64, Event)> = None;
        let streams = self.streams;
        let parts = |count, of| if streams.contains(of) { count } else { 0 };
        for _ in 0..hops {
            let hop = self.board.next_window;
            // First sample of the window's second hop; a hop has 32 samples.
            let first = i64::from(hop) * 32 + 32;
            for part in 0..parts(4, Streams::RAW) {
                self.raw(first + part * 8);
            }
            for part in 0..parts(2, Streams::FILTERED) {
                self.filtered(first / 4 + part * 4);
            }
            if streams.contains(Streams::CODES) {
                self.code(hop);
            } else {
                self.board.next_window += 1;
            }
            if let Some((us, event)) = late.take() {
                self.send_event(us, event);
            }
            if hop % event_every == event_every - 1 {
                let after = (self.next_random() % 62_500).cast_signed();
                let us = self.sample_us(first) + after;
                let sample = (us - self.start_us) * TICKS_PER_SECOND;
                let event = Event {
                    kind: EventKind::TriggerRise,
                    number: self.events,
                    sample: sample.unsigned_abs().div_ceil(1_000_000),
                };
                self.events += 1;
                late = Some((us, event));
            }
            self.now_us += HOP_US;
        }
        if let Some((us, event)) = late {
            self.send_event(us, event);
        }
    }

    /// Sends an event without loss, because the tests are about the rows of events.
    fn send_event(&mut self, us: i64, event: Event) {
        let device_us = u64::try_from(us - self.boot_us).unwrap();
        let frame = self.board.frame(device_us, &ToHost::Event(event));
        self.event_times_us.push(us);
        self.receive(&frame, self.now_us + 60_000);
    }

    fn raw(&mut self, first: i64) {
        // Converts a host time from microseconds to ticks.
        let ticks = |us: i64| us * TICKS_PER_SECOND / 1_000_000;
        let mut counts = Vec::new();
        for sample in first..first + 8 {
            let tick = i32::try_from(ticks(self.sample_us(sample) + 1)).unwrap();
            counts.extend(&tick.to_le_bytes()[..3]);
            counts.resize(counts.len() + 63 * 3, 0);
        }
        let raw = Raw {
            first_sample: u64::try_from(first).unwrap(),
            channels: 64,
            flags: Flags::empty(),
            counts: &counts,
        };
        self.send(self.sample_us(first + 7), &ToHost::Raw(raw));
    }

    fn filtered(&mut self, first: i64) {
        let mut values = Vec::new();
        for step in first..first + 4 {
            // A filtered step shows what was on the scalp `FILTER_DELAY_US` earlier.
            let us = self.sample_us(step * 4) - FILTER_DELAY_US;
            let tick = i32::try_from(us * TICKS_PER_SECOND / 1_000_000).unwrap();
            values.extend((tick << 5).to_le_bytes());
            values.resize(values.len() + 60 * 4, 0);
        }
        let filtered = Filtered {
            first_step: u64::try_from(first).unwrap(),
            electrodes: 61,
            fraction_bits: 5,
            flags: Flags::empty(),
            values: &values,
        };
        self.send(self.sample_us((first + 3) * 4), &ToHost::Filtered(filtered));
    }

    fn code(&mut self, hop: u32) {
        let last = (i64::from(hop) * 8 + 15) * 4;
        let start_us = self.sample_us(i64::from(hop) * 32) - FILTER_DELAY_US;
        let tick = u32::try_from(start_us * TICKS_PER_SECOND / 1_000_000).unwrap();
        let mut values = [0; 128];
        for (place, value) in values.iter_mut().enumerate().take(8) {
            *value = u8::try_from(tick >> (4 * place) & 15).unwrap();
        }
        let device_us = u64::try_from(self.sample_us(last) - self.boot_us).unwrap();
        let frame = self.board.code_of(device_us, &CodeValues::int8(&values));
        self.deliver(&frame, self.sample_us(last) + 2_000);
    }

    /// Ends the recording and returns the file.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        self.port.now = self.host_time(self.now_us + 100_000);
        self.port.recorder.ending(self.port.now);
        self.core.set_streaming(false);
        self.core.tick(self.port.now, &mut self.port);
        let commands = std::mem::take(&mut self.port.outgoing);
        let answers = self.board.answer(&commands);
        self.receive(&answers, self.now_us + 101_000);
        assert!(self.core.is_stopped());
        self.port.recorder.take()
    }
}
