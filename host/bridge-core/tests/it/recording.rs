//! Events in recordings by `rosneuro_recorder`: an hour of virtual time of every stream, with
//! clocks that are off, lost frames and restarts of the device.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "an hour of rows and microseconds"
)]

use bridge_core::{
    AnnouncedStream, Announcement, Core, Effects, EventPlace, EventStamps, PackedReconstruction,
    Reconstruction, RecordingStart, Settings, TimedCode, TimedPackedBlock,
};
use link::{Event, EventKind, Filtered, Flags, PackedCode, Raw, Streams, ToHost};
use neuro_ros::{NeuroEvent, NeuroFrame, Stamp};

use crate::board::{Board, Noise, at, model};
use crate::recorder::SETTINGS;

/// Time from one restart of the board to the next, and duration of the outage at each restart,
/// seconds.
const RESTART_EVERY_S: f64 = 130.0;
const OUTAGE_S: f64 = 2.345;
/// Time from the publication of a frame to its arrival at a recorder, seconds.
const TRANSFER_S: f64 = 0.0005;
const ADC_HZ: f64 = 512.0;
/// Group delay of the board's filters, ADC samples.
const DELAY: f64 = 5.12;

/// A recording as `rosneuro_recorder` and its library libxdffileio make it.
#[derive(Default)]
struct Recording {
    /// What the bridge knows of the recording.
    start: Option<RecordingStart>,
    /// The recorder's `starttime_`, seconds since 1970.
    start_s: f64,
    rate_hz: f64,
    /// For each row, the host time at which it was at the electrodes, seconds; `None` for fillers.
    rows: Vec<Option<f64>>,
    /// For each edge: its host time, seconds, and its row by the recorder's own stamp and by the
    /// stamp for other subscribers.
    edges: Vec<(f64, [i64; 2])>,
    /// Row of each report of missing data.
    gaps: Vec<i64>,
}

impl Recording {
    /// Takes a frame, as the recorder's `on_received_data` does.
    fn write(&mut self, frame: &NeuroFrame, now_us: i64) {
        if self.start.is_none() {
            self.start = Some(RecordingStart::new(frame, at(now_us)));
            self.rate_hz = frame.sr.into();
            let duration_s = f32::from(frame.eeg.info.nsamples) / f32::from(frame.sr);
            let arrival_s = at(now_us).wall_ns as f64 / 1e9 + TRANSFER_S;
            self.start_s = arrival_s - f64::from(duration_s);
        }
    }

    /// Returns the row at which readers of the file find an event with this stamp, as the
    /// recorder's `on_received_event` places it. The library rounds down and counts from 0; readers
    /// of GDF count from 1.
    fn place(&self, stamp: Stamp) -> i64 {
        let onset_s = stamp.nanoseconds() as f64 / 1e9 - self.start_s;
        (onset_s * self.rate_hz) as i64 - 1
    }

    /// Returns the host time at which row `row` was at the electrodes, seconds. The time of a
    /// filler follows from the nearest row that is not a filler.
    fn time_of(&self, row: i64, row_s: f64) -> Option<f64> {
        let at = |row: i64| *self.rows.get(usize::try_from(row).ok()?)?;
        let of = |away: i64| at(row + away).map(|time_s| time_s - away as f64 * row_s);
        (0..500).find_map(|away| of(away).or_else(|| of(-away)))
    }
}

/// Passes what the core publishes to two recordings, the second of which begins later.
struct Tape {
    settings: Settings,
    sent: Vec<u8>,
    now_us: i64,
    /// For each run of the board, the host time at which the device time was 0, seconds.
    runs_s: Vec<f64>,
    /// Number of restarts before the newest row, and that row's device time, microseconds.
    newest: (usize, i64),
    /// Host seconds per ADC sample, and per second of the microcontroller.
    sample_s: f64,
    clock_s: f64,
    /// Host time of the newest edge, seconds.
    edge_s: f64,
    codes: Option<Reconstruction>,
    packed: Option<PackedReconstruction>,
    recordings: Vec<Recording>,
}

impl Tape {
    /// Records a frame of `stream`. Its first row was at the electrodes `back` ADC samples before
    /// the device time in that row's status words, as docs/topics.md states.
    fn write(&mut self, stream: AnnouncedStream, frame: &NeuroFrame, back: f64) {
        if self.settings.announced != stream {
            return;
        }
        let mut rows = Vec::new();
        for (row, words) in frame.tri.data.chunks(8).enumerate() {
            let device_us =
                i64::from(words[3]) | i64::from(words[4]) << 16 | i64::from(words[5]) << 32;
            // A row between two runs has no device time, even if it is decoded from an older code.
            if words[0] & 0x8000 != 0 || device_us == 0 {
                rows.push(None);
                continue;
            }
            if device_us < self.newest.1 {
                self.newest.0 += 1;
            }
            self.newest.1 = device_us;
            let device_s = self.runs_s[self.newest.0] + device_us as f64 * 1e-6 * self.clock_s;
            // All rows of a reconstructed frame have the words of one code or block.
            let ahead =
                if stream == AnnouncedStream::Reconstructed { 4.0 * row as f64 } else { 0.0 };
            rows.push(Some(device_s + (ahead - back) * self.sample_s));
        }
        for recording in &mut self.recordings {
            recording.write(frame, self.now_us);
            recording.rows.extend(&rows);
        }
    }
}

impl Effects for Tape {
    fn send(&mut self, frame: &[u8]) {
        self.sent.extend_from_slice(frame);
    }

    fn announce(&mut self, announcement: &Announcement) {
        let (device, settings) = (&announcement.device, self.settings);
        if announcement.decodable && self.codes.is_none() {
            self.codes = Some(Reconstruction::new(device, model(), settings));
            self.packed = PackedReconstruction::new(device, &model(), settings);
        }
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        self.write(AnnouncedStream::Encoded, frame, 60.0 + DELAY);
    }

    fn decode(&mut self, window: TimedCode) {
        let frame = self.codes.as_mut().and_then(|codes| codes.next_times(&window).cloned());
        // A frame has the first hop of the window, or with low latency the last one.
        let back = if self.settings.low_latency { 28.0 } else { 60.0 };
        if let Some(frame) = frame {
            self.write(AnnouncedStream::Reconstructed, &frame, back + DELAY);
        }
    }

    fn decode_block(&mut self, block: TimedPackedBlock) {
        let frame = self.packed.as_mut().and_then(|packed| packed.next_times(&block).cloned());
        if let Some(frame) = frame {
            self.write(AnnouncedStream::Reconstructed, &frame, 28.0 + DELAY);
        }
    }

    fn publish_raw(&mut self, frame: &NeuroFrame) {
        self.write(AnnouncedStream::Raw, frame, 0.0);
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        self.write(AnnouncedStream::Filtered, frame, DELAY);
    }

    fn publish_event(&mut self, event: &NeuroEvent, place: EventPlace) {
        for recording in &mut self.recordings {
            let Some(start) = &recording.start else {
                continue;
            };
            let row = recording.place(start.stamp(place.row.unwrap()));
            let common = recording.place(event.header.stamp);
            match event.event {
                1 => recording.edges.push((self.edge_s, [row, common])),
                _ => recording.gaps.push(row),
            }
        }
    }
}

/// A board and a bridge. The board's ADC and its microcontroller have clocks of their own.
struct Rig {
    core: Core,
    board: Board,
    tape: Tape,
    noise: Noise,
}

impl Rig {
    /// Delivers bytes of the board, and lets it answer.
    fn receive(&mut self, bytes: &[u8]) {
        let now = at(self.tape.now_us);
        self.core.receive(bytes, now, &mut self.tape);
        while !self.tape.sent.is_empty() {
            let commands = std::mem::take(&mut self.tape.sent);
            let answers = self.board.answer(&commands);
            self.core.receive(&answers, now, &mut self.tape);
        }
    }

    /// Delivers a message that was made at the host time `made_s`, after 1 to 4 ms, unless it is
    /// lost; `loss` is the fraction of lost messages. `None` stands for the next code.
    fn send(&mut self, made_s: f64, message: Option<&ToHost>, loss: f64) {
        let run_s = *self.tape.runs_s.last().unwrap();
        let device_us = ((made_s - run_s) / self.tape.clock_s * 1e6) as u64;
        let frame = match message {
            Some(message) => self.board.frame(device_us, message),
            None => self.board.code(device_us, 1),
        };
        let arrival_us = ((made_s + 0.001 + 0.003 * self.noise.number()) * 1e6) as i64;
        self.tape.now_us = arrival_us.max(self.tape.now_us + 1);
        if self.noise.number() >= loss {
            self.receive(&frame);
        }
    }

    /// Takes ADC sample `sample` of the run, and sends the messages that it completes.
    fn take_sample(&mut self, now_s: f64, sample: u64, loss: f64) {
        let settings = self.tape.settings;
        if settings.announced == AnnouncedStream::Raw && sample % 8 == 7 {
            let raw = Raw {
                first_sample: sample - 7,
                channels: 2,
                flags: Flags::empty(),
                counts: &[0; 8 * 2 * 3],
            };
            self.send(now_s, Some(&ToHost::Raw(raw)), loss);
        }
        if settings.announced == AnnouncedStream::Filtered && sample % 16 == 12 {
            let filtered = Filtered {
                first_step: sample / 4 - 3,
                electrodes: 2,
                fraction_bits: 0,
                flags: Flags::empty(),
                values: &[0; 4 * 2 * 4],
            };
            self.send(now_s, Some(&ToHost::Filtered(filtered)), loss);
        }
        // A packed block ends with step 7, a window with step 15.
        if sample % 32 == 28 && settings.streams.contains(Streams::PACKED) {
            let code = PackedCode {
                block: (sample / 32) as u32,
                rate: 4,
                flags: Flags::empty(),
                clipped: 0,
                saturated: 0,
                bytes: &[],
            };
            self.send(now_s, Some(&ToHost::PackedCode(code)), loss);
        } else if sample % 32 == 28 && sample >= 60 {
            self.send(now_s, None, loss);
        }
    }

    /// Records for `seconds`, with a trigger edge about every second. A second recording begins
    /// after half of this time. If `loss` is not 0, this fraction of the frames is lost, and the
    /// board restarts every [`RESTART_EVERY_S`].
    fn record(&mut self, seconds: f64, loss: f64) {
        self.core.connected(at(self.tape.now_us), &mut self.tape);
        self.receive(&[]);
        let (mut sample, mut number, mut restart_s) = (0, 0, RESTART_EVERY_S);
        let (mut now_s, mut edge_s) = (0.0, 30.0);
        while now_s < seconds {
            now_s = self.tape.runs_s.last().unwrap() + sample as f64 * self.tape.sample_s;
            let begun = self.tape.recordings.len() as f64;
            if begun < 2.0 && now_s > 20.0 + begun * seconds / 2.0 {
                self.tape.recordings.push(Recording::default());
            }
            if loss > 0.0 && now_s > restart_s {
                restart_s += RESTART_EVERY_S;
                now_s += OUTAGE_S;
                self.board.reboot();
                (sample, number) = (0, 0);
                self.tape.runs_s.push(now_s);
                self.tape.now_us = (now_s * 1e6) as i64;
                let hello = self.board.hello();
                self.receive(&hello);
                // Make the first edge of the run come before its first code, step and message.
                edge_s = now_s + 0.005;
            }
            if edge_s <= now_s {
                let edge = ToHost::Event(Event { kind: EventKind::TriggerRise, number, sample });
                self.tape.edge_s = edge_s;
                self.send(edge_s, Some(&edge), 0.0);
                number += 1;
                edge_s += 0.5 + self.noise.number();
            }
            self.take_sample(now_s, sample, loss);
            sample += 1;
        }
    }
}

/// Records `seconds` with clocks of ADC and microcontroller that are fast by `ppm`. Returns the
/// largest errors of edges, in rows: with the recorder's own stamps, and with the stamps for other
/// subscribers.
fn largest_errors(settings: Settings, ppm: [f64; 2], seconds: f64, loss: f64) -> [f64; 2] {
    let [adc, clock] = ppm.map(|ppm| 1.0 / (1.0 + ppm * 1e-6));
    let mut board = Board::new();
    if settings.announced != AnnouncedStream::Reconstructed {
        // Few electrodes keep the test short; their codes cannot be decoded.
        (board.labels, board.channels) = ("C3 C4".to_owned(), 2);
    }
    let tape = Tape {
        settings,
        sent: Vec::new(),
        now_us: 1_000_000,
        runs_s: vec![1.0],
        newest: (0, 0),
        sample_s: adc / ADC_HZ,
        clock_s: clock,
        edge_s: 0.0,
        codes: None,
        packed: None,
        recordings: Vec::new(),
    };
    let core = Core::new(settings, Some(model()));
    let mut rig = Rig { core, board, tape, noise: Noise(5) };
    rig.record(seconds, loss);
    let mut most = [0.0_f64; 2];
    assert_eq!(rig.tape.recordings.len(), 2);
    for recording in &rig.tape.recordings {
        let row_s = adc / recording.rate_hz;
        let edges = recording.edges.iter();
        let edges: Vec<_> = edges.filter(|(edge_s, _)| *edge_s < seconds - 3.0).collect();
        assert!(edges.len() as f64 > seconds / 4.0, "{} edges", edges.len());
        for (edge_s, places) in edges {
            for (most, place) in most.iter_mut().zip(places) {
                let row_at_s = recording.time_of(*place, row_s).unwrap_or(f64::INFINITY);
                *most = most.max(((row_at_s - edge_s) / row_s).abs());
            }
        }
        // Do not check gaps in reconstructed signals: the codes before and after a lost code
        // contain some of its rows too.
        if settings.announced != AnnouncedStream::Reconstructed {
            let is_filler = |row: i64| recording.rows[row as usize].is_none();
            let end = recording.rows.len();
            let gaps = recording.gaps.iter().copied();
            for row in gaps.filter(|row| *row > 0 && (*row as usize) < end) {
                assert!(is_filler(row) && !is_filler(row - 1), "gap at row {row}");
            }
        }
    }
    most
}

#[test]
fn an_edge_is_at_most_a_row_from_its_place_after_an_hour_of_any_clock() {
    let codes = Streams::CODES | Streams::EVENTS;
    let packed = Streams::PACKED | Streams::EVENTS;
    let (raw, filtered) = (codes | Streams::RAW, codes | Streams::FILTERED);
    let reconstructed = AnnouncedStream::Reconstructed;
    for (name, announced, streams, low_latency) in [
        ("encoded", AnnouncedStream::Encoded, codes, false),
        ("reconstructed from codes", reconstructed, codes, false),
        ("the same, low latency", reconstructed, codes, true),
        ("reconstructed from packed", reconstructed, packed, false),
        ("the same, low latency", reconstructed, packed, true),
        ("raw", AnnouncedStream::Raw, raw, false),
        ("filtered", AnnouncedStream::Filtered, filtered, false),
    ] {
        let settings = Settings {
            announced,
            streams,
            low_latency,
            event_stamps: EventStamps::Recorder,
            ..SETTINGS
        };
        // Clocks of ADC and microcontroller, ppm; duration, s; fraction of frames that are lost.
        let errors = [
            ([0.0, 0.0], 200.0, 0.0),
            ([300.0, 300.0], 200.0, 0.05),
            ([-3e3, -3e3], 200.0, 0.05),
            ([1e4, 1e4], 3600.0, 0.05),
            ([1e4, 0.0], 200.0, 0.05),
        ]
        .map(|(ppm, seconds, loss)| largest_errors(settings, ppm, seconds, loss));
        println!("{name}: {:.2?} rows", errors.map(|[error, _]| error));
        assert!(errors.iter().all(|[error, _]| *error <= 1.0), "{name}: {errors:?}");
        // With exact clocks, the stamps for other subscribers are off by at most half a row plus
        // 3.5 ms, by which the first frame can be more delayed than later frames.
        assert!(errors[0][1] <= 2.5, "{name}: {errors:?}");
    }
}
