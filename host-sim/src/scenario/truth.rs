//! Records everything that the board made, with exact host times.

use std::collections::VecDeque;
use std::rc::Rc;

use link::{Decoder, EventKind, Flags, MAX_FRAME, ToHost};

use super::clock::BoardClock;

/// Time between two steps and between two samples by the converters' clock, microseconds.
const STEP_US: f64 = 1e6 / model::STEP_RATE_HZ as f64;
const SAMPLE_US: f64 = 1e6 / model::ADC_RATE_HZ as f64;

/// Returns the duration of `rows` rows that are `period_us` apart, microseconds.
#[expect(clippy::cast_precision_loss, reason = "a few rows")]
fn time_us(rows: usize, period_us: f64) -> f64 {
    rows as f64 * period_us
}

/// Number of newest samples that are kept: more than a frame holds.
const KEPT_SAMPLES: usize = 64;

/// A topic whose rows are checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TopicKind {
    Encoded,
    Packed,
    Raw,
    Filtered,
}

/// Place of a code, packed block, sample or step: number of its run, from 0, and index in this run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) run: usize,
    pub(super) index: u64,
    /// Host time at which the sample that the stamp refers to was at the electrodes, microseconds.
    pub(super) scalp_us: f64,
}

/// Values of a row, as they must be published.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    /// Codes, samples and steps.
    Numbers(Vec<f32>),
    /// A packed block: bytes and rate.
    Packed(Vec<u8>, u8),
}

/// A row of a topic.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) place: Place,
    pub(super) flags: u16,
    pub(super) values: Values,
}

/// A frame that the board made.
#[derive(Debug)]
pub(super) struct Made {
    /// The bytes of the frame between its two zeros.
    body: Vec<u8>,
    /// Host time of the sample to which the frame's device time belongs, microseconds.
    pub(super) at_us: f64,
    pub(super) content: Content,
}

#[derive(Debug)]
pub(super) enum Content {
    /// Rows of a topic, at least one.
    Rows(TopicKind, Vec<Row>),
    /// An edge of the trigger.
    Edge {
        rises: bool,
    },
    /// Number of the current run of codes, and number of windows made in this run.
    Stats {
        run: usize,
        next_window: u32,
    },
    Ack,
    Other,
}

/// Meaning of the bytes that the host has received between two zeros.
#[derive(Clone, Debug)]
pub(super) enum Segment {
    /// An unchanged frame of the board that has arrived for the first time.
    Frame(Rc<Made>),
    /// The previous frame once more.
    Again,
    Damaged,
}

/// Everything that the board made.
#[derive(Debug, Default)]
pub(super) struct Truth {
    decoder: Box<Decoder<MAX_FRAME>>,
    /// The newest samples of the current run, microvolts, and the number of all its samples.
    samples: VecDeque<Vec<f32>>,
    sample_count: u64,
    /// Number of each topic's current run; the first run has number 0.
    runs: [Option<usize>; 4],
    scales: Vec<(f32, i8)>,
    uv_per_count: f64,
    group_delay_us: f64,
    /// Frames not yet received by the host, oldest first, and the newest received frame.
    waiting: VecDeque<Rc<Made>>,
    newest: Option<Rc<Made>>,
    /// Numbers of frames and of trigger edges that the board has made.
    pub(super) frames: u64,
    pub(super) edges: u64,
    /// Union of the flags of all codes, blocks, samples and steps.
    pub(super) flags: Flags,
}

impl Truth {
    /// Records a sample that the driver has read from the converters. Call it before
    /// [`Self::record`] gets the frames that this sample completes.
    pub(super) fn record_sample(&mut self, counts: impl Iterator<Item = i32>) {
        #[expect(clippy::cast_possible_truncation, reason = "within 187500 uV")]
        let microvolts = counts.map(|count| (f64::from(count) * self.uv_per_count) as f32);
        let row = microvolts.collect();
        self.samples.push_back(row);
        if self.samples.len() > KEPT_SAMPLES {
            self.samples.pop_front();
        }
        self.sample_count += 1;
    }

    /// Records that the board starts a run with its next sample.
    pub(super) fn start_run(&mut self) {
        self.samples.clear();
        self.sample_count = 0;
    }

    /// Returns the [`Place`] of the row with index `index` in its run. The stamp of a raw row
    /// refers to the sample that was converted `before_us` microseconds of the converters' clock
    /// before the host time `at_us`. The stamp of any other row refers to a time that is earlier by
    /// the filters' delay.
    fn place(
        &mut self,
        kind: TopicKind,
        index: u64,
        at_us: f64,
        before_us: f64,
        rate: f64,
    ) -> Place {
        let run = &mut self.runs[kind as usize];
        if index == 0 {
            *run = Some(run.map_or(0, |run| run + 1));
        }
        let delay_us = match kind {
            TopicKind::Raw => 0.0,
            _ => self.group_delay_us,
        };
        Place { run: run.unwrap_or(0), index, scalp_us: at_us - (before_us + delay_us) * rate }
    }

    /// Records a frame that the board has just made, and returns it.
    ///
    /// # Panics
    /// If the board makes bytes that are not a frame.
    pub(super) fn record(&mut self, frame: &[u8], clock: &BoardClock) -> Rc<Made> {
        let mut decoder = std::mem::take(&mut self.decoder);
        let made = decoder.next::<ToHost>(&mut &*frame);
        let decoded = made.expect("the board makes whole frames").expect("valid ones");
        let at_us = clock.host_us_of(decoded.header.device_time_us);
        let content = self.content(&decoded.message, at_us, clock.converter_rate());
        self.decoder = decoder;
        let made = Rc::new(Made { body: frame[1..frame.len() - 1].to_vec(), at_us, content });
        self.frames += 1;
        self.waiting.push_back(Rc::clone(&made));
        made
    }

    fn content(&mut self, message: &ToHost, at_us: f64, rate: f64) -> Content {
        let row = |place, flags: Flags, values| Row { place, flags: flags.bits(), values };
        match message {
            ToHost::Capabilities(capabilities) => {
                let zero_points = capabilities.code_zero_point.iter().copied();
                let scales = capabilities.code_scale.iter().copied();
                self.scales = scales.zip(zero_points).collect();
                self.uv_per_count = f64::from(capabilities.lsb_nv) / 1000.0;
                self.group_delay_us = capabilities.group_delay_us.into();
                Content::Other
            }
            ToHost::Code(code) => {
                let kind = TopicKind::Encoded;
                let before_us = time_us(model::STEPS - 1, STEP_US);
                let place = self.place(kind, code.window.into(), at_us, before_us, rate);
                // `docs/wire-format.md` defines z = (level - zero point) * scale.
                let levels = code.values.levels().zip(&self.scales);
                #[expect(clippy::cast_precision_loss, reason = "at most 17 bits")]
                let z =
                    levels.map(|(level, (scale, zero))| (level - i32::from(*zero)) as f32 * scale);
                let rows = vec![row(place, code.flags, Values::Numbers(z.collect()))];
                self.flags |= code.flags;
                Content::Rows(TopicKind::Encoded, rows)
            }
            ToHost::PackedCode(code) => {
                let kind = TopicKind::Packed;
                let before_us = time_us(model::HOP - 1, STEP_US);
                let place = self.place(kind, code.block.into(), at_us, before_us, rate);
                let values = Values::Packed(code.bytes.to_vec(), code.rate);
                self.flags |= code.flags;
                Content::Rows(TopicKind::Packed, vec![row(place, code.flags, values)])
            }
            ToHost::Raw(raw) => {
                let count = raw.counts().count() / usize::from(raw.channels.max(1));
                self.raw_rows(raw.first_sample, count, raw.flags, at_us, rate)
            }
            ToHost::CompressedRaw(raw) => {
                self.raw_rows(raw.first_sample, raw.samples.into(), raw.flags, at_us, rate)
            }
            ToHost::Filtered(filtered) => {
                let width = usize::from(filtered.electrodes);
                let uv = self.uv_per_count * 2_f64.powi(-i32::from(filtered.fraction_bits));
                #[expect(clippy::cast_possible_truncation, reason = "within 187500 uV")]
                let values: Vec<f32> =
                    filtered.values().map(|value| (f64::from(value) * uv) as f32).collect();
                let count = values.len() / width;
                let rows = values.chunks_exact(width).enumerate().map(|(number, values)| {
                    let index = filtered.first_step + number as u64;
                    let before_us = time_us(count - 1 - number, STEP_US);
                    let place = self.place(TopicKind::Filtered, index, at_us, before_us, rate);
                    row(place, filtered.flags, Values::Numbers(values.to_vec()))
                });
                let rows = rows.collect();
                self.flags |= filtered.flags;
                Content::Rows(TopicKind::Filtered, rows)
            }
            ToHost::Event(event) => {
                self.edges += 1;
                let rises = event.kind == EventKind::TriggerRise;
                Content::Edge { rises }
            }
            ToHost::Stats(stats) => Content::Stats {
                run: self.runs[TopicKind::Encoded as usize].unwrap_or_default(),
                next_window: stats.next_window,
            },
            ToHost::Ack(_) => Content::Ack,
            _ => Content::Other,
        }
    }

    /// Returns the rows of `count` samples from number `first` on, which the board has just read.
    /// Takes the values from the converters, not from the frame.
    fn raw_rows(
        &mut self,
        first: u64,
        count: usize,
        flags: Flags,
        at_us: f64,
        rate: f64,
    ) -> Content {
        self.flags |= flags;
        let rows = (0..count).map(|number| {
            let index = first + number as u64;
            let ago = usize::try_from(self.sample_count - index).unwrap_or(usize::MAX);
            let sample = self.samples.len().checked_sub(ago);
            let values = sample.and_then(|sample| self.samples.get(sample));
            let values = Values::Numbers(values.cloned().unwrap_or_default());
            let before_us = time_us(count - 1 - number, SAMPLE_US);
            Row {
                place: self.place(TopicKind::Raw, index, at_us, before_us, rate),
                flags: flags.bits(),
                values,
            }
        });
        Content::Rows(TopicKind::Raw, rows.collect())
    }

    /// Identifies the bytes that the host has received between two zeros.
    pub(super) fn identify(&mut self, segment: &[u8]) -> Segment {
        if self.newest.as_ref().is_some_and(|newest| newest.body == segment) {
            return Segment::Again;
        }
        let found = self.waiting.iter().position(|made| made.body == segment);
        let Some(found) = found else {
            return Segment::Damaged;
        };
        let frame = self.waiting.drain(..=found).next_back();
        self.newest.clone_from(&frame);
        frame.map_or(Segment::Damaged, Segment::Frame)
    }
}
