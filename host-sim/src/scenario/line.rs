//! The line between board and host, with its random faults and the buffers at both ends.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::file::{LineKind, Noise, Scenario};
use crate::outbox::{Outbox, WhenFull};
use crate::synthetic::Noise as Random;

/// Size of a chunk, bytes; equal to the size of a USB packet at full speed.
const CHUNK: usize = 64;

/// Random faults of one direction.
#[derive(Debug)]
pub(super) struct Faults {
    noise: Noise,
    random: Random,
    /// Number of frames that the current burst still drops.
    burst: u64,
    /// Number of bits before the next bit error.
    bits: u64,
    /// Number of times that each fault has occurred, in the order of [`Noise::rates`].
    pub(super) counts: [u64; 5],
}

impl Faults {
    /// Creates the faults of a direction: 0 is to the host, 1 to the board.
    pub(super) fn new(noise: Noise, seed: u64, direction: u64) -> Self {
        let mut faults = Self {
            noise,
            // The random streams with lower numbers belong to the synthetic EEG.
            random: Random::new(seed, 1_000 + direction),
            burst: 0,
            bits: 0,
            counts: [0; 5],
        };
        faults.bits = faults.run(noise.bit_errors);
        faults
    }

    /// Ends all random faults.
    pub(super) fn silence(&mut self) {
        self.noise = Noise::default();
        (self.burst, self.bits) = (0, u64::MAX);
    }

    /// Returns a random number in 0..1.
    fn unit(&mut self) -> f64 {
        self.random.uniform(0.0, 1.0)
    }

    /// Returns a random number of failed trials before the first success, where each trial succeeds
    /// with probability `rate`.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "not negative; saturates"
    )]
    fn run(&mut self, rate: f64) -> u64 {
        if rate <= 0.0 {
            return u64::MAX;
        }
        ((1.0 - self.unit()).ln() / (-rate).ln_1p()) as u64
    }

    fn happens(&mut self, rate: f64) -> bool {
        rate > 0.0 && self.unit() < rate
    }

    /// Applies the random faults to a frame and returns the bytes that arrive.
    fn apply(&mut self, frame: &[u8]) -> Vec<u8> {
        let noise = self.noise;
        if self.burst == 0 && self.happens(noise.frames_dropped) {
            self.burst = 1 + self.run(1.0 / noise.burst).min(100_000);
        }
        if self.burst > 0 {
            self.burst -= 1;
            self.counts[1] += 1;
            return Vec::new();
        }
        let copies = 1 + usize::from(self.happens(noise.frames_duplicated));
        self.counts[2] += copies as u64 - 1;
        let mut arrives = Vec::with_capacity(frame.len());
        for chunk in std::iter::repeat_n(frame, copies).flat_map(|frame| frame.chunks(CHUNK)) {
            if self.happens(noise.chunks_dropped) {
                self.counts[3] += 1;
                continue;
            }
            arrives.extend_from_slice(chunk);
            if self.happens(noise.chunks_duplicated) {
                self.counts[4] += 1;
                arrives.extend_from_slice(chunk);
            }
        }
        let mut bit = 0;
        while self.bits < 8 * arrives.len() as u64 - bit {
            bit += self.bits;
            #[expect(clippy::cast_possible_truncation, reason = "a bit of a frame")]
            let at = bit as usize;
            arrives[at / 8] ^= 1 << (at % 8);
            self.counts[0] += 1;
            bit += 1;
            self.bits = self.run(noise.bit_errors);
        }
        if self.bits != u64::MAX {
            self.bits -= 8 * arrives.len() as u64 - bit;
        }
        arrives
    }
}

/// The line, with the board's queue of frames at one end and the host's buffer at the other.
#[derive(Debug)]
pub(super) struct Line {
    kind: LineKind,
    bytes_per_us: f64,
    delay_us: f64,
    jitter_us: f64,
    buffer_bytes: usize,
    pub(super) faults: Faults,
    /// Whether bytes reach the host.
    is_up: bool,
    /// The board's queue, which drops its oldest frames as a board does. The ages of its frames are
    /// measured in host time, which begins at `start`.
    queue: Outbox,
    start: Instant,
    /// Host time at which the line becomes free for the next frame, microseconds.
    free_us: f64,
    /// Number of bytes of the next frame after which the board loses its power; 0 after the loss of
    /// power.
    cut: Option<usize>,
    /// Bytes that were sent and not read, and the host time of their arrival, microseconds.
    sent: VecDeque<(f64, Vec<u8>)>,
    sent_bytes: usize,
    pub(super) dropped_by_board: u64,
    /// Number of frames lost because the host's buffer was full or the cable was unplugged.
    pub(super) unreceived: u64,
}

impl Line {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let line = scenario.line;
        Self {
            kind: line.kind,
            bytes_per_us: line.bytes_per_us(),
            delay_us: line.delay_ms * 1e3,
            jitter_us: line.jitter_ms * 1e3,
            buffer_bytes: scenario.host.buffer_bytes,
            faults: Faults::new(scenario.noise, scenario.seed, 0),
            is_up: true,
            queue: Outbox::new(WhenFull::DropOldest),
            start: Instant::now(),
            free_us: 0.0,
            cut: None,
            sent: VecDeque::new(),
            sent_bytes: 0,
            dropped_by_board: 0,
            unreceived: 0,
        }
    }

    /// Queues a frame of the board, and returns how many frames the queue dropped to make room.
    pub(super) fn push(&mut self, frame: &[u8], now_us: f64) -> u32 {
        self.carry(now_us);
        let before = self.queue.dropped();
        let now = self.start + Duration::from_secs_f64(now_us / 1e6);
        self.queue.push_at(frame, now);
        let dropped = self.queue.dropped().wrapping_sub(before);
        self.dropped_by_board += u64::from(dropped);
        self.carry(now_us);
        dropped
    }

    /// Sends queued frames until `now_us`, as far as the line carries them.
    pub(super) fn carry(&mut self, now_us: f64) {
        let waits = self.kind != LineKind::Uart;
        while self.free_us <= now_us && self.cut != Some(0) {
            if waits && (!self.is_up || self.sent_bytes >= self.buffer_bytes) {
                // The next frame starts when the line is up and the host's buffer has room again.
                self.free_us = now_us;
                return;
            }
            let Some(mut frame) = self.queue.try_pop() else {
                self.free_us = now_us;
                return;
            };
            if let Some(bytes) = self.cut {
                frame.truncate(bytes.clamp(1, frame.len() - 1));
                self.cut = Some(0);
            }
            #[expect(clippy::cast_precision_loss, reason = "some kilobytes")]
            let took_us = frame.len() as f64 / self.bytes_per_us;
            self.free_us += took_us;
            let bytes = self.faults.apply(&frame);
            let is_full = self.sent_bytes + bytes.len() > self.buffer_bytes;
            if !self.is_up || (!waits && is_full) {
                self.unreceived += 1;
                continue;
            }
            let jitter_us = self.jitter_us * self.faults.unit().powi(3);
            let arrival_us = self.free_us + self.delay_us + jitter_us;
            let last_us = self.sent.back().map_or(0.0, |(us, _)| *us);
            self.sent_bytes += bytes.len();
            self.sent.push_back((arrival_us.max(last_us), bytes));
        }
    }

    /// Returns the host time at which the next unread bytes arrive, microseconds; infinite if there
    /// are none.
    pub(super) fn next_arrival_us(&self) -> f64 {
        self.sent.front().map_or(f64::INFINITY, |(us, _)| *us)
    }

    /// Returns up to `most` bytes that have arrived by `now_us`.
    pub(super) fn read(&mut self, now_us: f64, most: usize) -> Vec<u8> {
        let mut read = Vec::new();
        while let Some((at_us, bytes)) = self.sent.front_mut()
            && *at_us <= now_us
            && read.len() < most
        {
            let count = bytes.len().min(most - read.len());
            read.extend(bytes.drain(..count));
            if bytes.is_empty() {
                self.sent.pop_front();
            }
        }
        self.sent_bytes -= read.len();
        self.carry(now_us);
        read
    }

    /// Makes the board lose its power after `bytes` bytes of its next frame.
    pub(super) fn cut_after(&mut self, bytes: usize) {
        self.cut = Some(bytes);
    }

    /// Returns the host time at which the board lost its power in the middle of a frame; `None` if
    /// it has not lost its power.
    pub(super) fn cut_us(&self) -> Option<f64> {
        (self.cut == Some(0)).then_some(self.free_us)
    }

    /// Interrupts or restores the line. An interruption loses the bytes that the host has not read,
    /// except on TCP, which sends them again.
    pub(super) fn set_up(&mut self, is_up: bool, now_us: f64) {
        self.carry(now_us);
        self.is_up = is_up;
        if !is_up && self.kind != LineKind::Tcp {
            self.sent.clear();
            self.sent_bytes = 0;
        }
    }

    pub(super) fn is_up(&self) -> bool {
        self.is_up
    }

    /// Discards the frames that the board's memory held when it lost its power.
    pub(super) fn lose_queue(&mut self, now_us: f64) {
        let _ = self.queue.take_all();
        self.cut = None;
        self.free_us = self.free_us.max(now_us);
    }
}

/// The line from host to board: commands arrive after a constant delay.
#[derive(Debug)]
pub(super) struct CommandLine {
    delay_us: f64,
    faults: Faults,
    sent: VecDeque<(f64, Vec<u8>)>,
}

impl CommandLine {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            delay_us: scenario.line.delay_ms * 1e3,
            faults: Faults::new(scenario.noise, scenario.seed, 1),
            sent: VecDeque::new(),
        }
    }

    pub(super) fn send(&mut self, frame: &[u8], now_us: f64) {
        let bytes = self.faults.apply(frame);
        self.sent.push_back((now_us + self.delay_us, bytes));
    }

    /// Returns the host time at which the next command arrives, microseconds.
    pub(super) fn next_arrival_us(&self) -> f64 {
        self.sent.front().map_or(f64::INFINITY, |(us, _)| *us)
    }

    pub(super) fn receive(&mut self) -> Vec<u8> {
        self.sent.pop_front().map(|(_, bytes)| bytes).unwrap_or_default()
    }

    /// Discards the commands that are on their way to the board.
    pub(super) fn lose(&mut self) {
        self.sent.clear();
    }

    pub(super) fn silence(&mut self) {
        self.faults.silence();
    }
}
