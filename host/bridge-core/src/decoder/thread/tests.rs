//! Tests of the decoder thread. A sink records the frames that the thread publishes.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use link::{Capabilities, Hello, ResetCause};
use neuro_ros::{NeuroFrame, Sink, SinkError, Stamp, TriWords};

use super::{DecoderThread, Ordering, QUEUE_WINDOWS};
use crate::decoder::audit::AuditedWindow;
use crate::decoder::model::Model;
use crate::decoder::packed::{PackedBytes, PackedReconstruction, TimedPackedBlock};
use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::device::Device;
use crate::settings::Settings;

/// Timeout of each wait for the thread, long enough for a busy machine.
const TIMEOUT: Duration = Duration::from_mins(1);

/// Sequence number of each frame that the sink received, and nanoseconds of its stamp.
type Frames = Arc<Mutex<Vec<(u32, i64)>>>;

/// Sink that records the sequence number and the stamp of every frame.
#[derive(Clone, Default)]
struct Places {
    frames: Frames,
    /// Whether the sink reports that nobody receives the frames.
    is_unused: Arc<AtomicBool>,
    /// Time for which the sink blocks the thread at each frame.
    delay: Duration,
}

impl Places {
    fn start(&self) -> DecoderThread {
        DecoderThread::start(Box::new(self.clone())).unwrap()
    }
}

impl Sink<NeuroFrame> for Places {
    fn publish(&mut self, frame: &NeuroFrame) -> Result<(), SinkError> {
        std::thread::sleep(self.delay);
        let stamp = frame.header.stamp.nanoseconds();
        let mut frames = self.frames.lock().unwrap();
        frames.push((frame.neuroheader.seq, stamp));
        Ok(())
    }

    fn dropped(&self) -> u64 {
        0
    }

    fn has_receivers(&self) -> bool {
        !self.is_unused.load(Ordering::Relaxed)
    }
}

/// Starts a decoder thread, and returns it with the record of its frames.
fn start() -> (Frames, DecoderThread) {
    let places = Places::default();
    let decoder = places.start();
    (places.frames, decoder)
}

/// Returns the sequence numbers of the recorded frames.
fn numbers(frames: &Frames) -> Vec<u32> {
    let frames = frames.lock().unwrap();
    frames.iter().map(|(number, _)| *number).collect()
}

/// Returns a code with all values zero, or the placeholder for a lost one. To make each frame
/// recognisable, its stamp is `window` nanoseconds after 1970.
fn code(window: u32, is_received: bool) -> TimedCode {
    TimedCode {
        z: is_received.then(|| vec![0.0; 128]),
        stamp: Stamp::from_nanoseconds(window.into()),
        words: TriWords { window, ..TriWords::default() },
    }
}

fn device(model: &Model) -> Device {
    let labels = model.electrodes().join(" ");
    let hello = Hello {
        firmware: "test",
        board: "board",
        chip_uid: [7; 12],
        model_id: model.id(),
        session_id: 1,
        reset_cause: ResetCause::PowerOn,
        fault: "",
    };
    let capabilities = Capabilities {
        adc_rate_hz: 512,
        step_rate_hz: 128,
        window_steps: 16,
        hop_steps: 8,
        channels: 64,
        lsb_nv: 22.351_742,
        mains_hz: 50,
        group_delay_us: 10_000,
        labels: &labels,
        filters: "none",
        code_format: link::CodeFormat::Int8,
        code_scale: std::iter::repeat_n(0.5, 128).collect(),
        code_zero_point: std::iter::repeat_n(1, 128).collect(),
    };
    Device::new(&hello, &capabilities).unwrap()
}

fn reconstruction() -> Reconstruction {
    let model = Arc::new(Model::embedded().unwrap());
    Reconstruction::new(&device(&model), model, Settings::default())
}

fn unpacked() -> PackedReconstruction {
    let model = Arc::new(Model::embedded().unwrap());
    PackedReconstruction::new(&device(&model), &model, Settings::default()).unwrap()
}

#[test]
fn codes_beyond_a_full_queue_are_counted() {
    let (count, mut decoder) = start();
    // Simulate more waiting codes than the thread can decode during this test.
    let progress = Arc::clone(&decoder.progress);
    progress.waiting.store(QUEUE_WINDOWS, Ordering::Relaxed);
    for _ in 0..3 {
        decoder.decode(code(0, true));
    }
    progress.waiting.store(0, Ordering::Relaxed);
    // No device was announced with `start_device`, so the thread can publish nothing.
    assert_eq!(decoder.finish(TIMEOUT).not_decoded, 3);
    assert!(count.lock().unwrap().is_empty());
}

#[test]
fn every_filler_of_a_long_outage_is_published_and_numbers_continue_with_another_device() {
    let (count, mut decoder) = start();
    for _ in 0..2 {
        decoder.start_device(reconstruction(), None);
        for window in 0..2500 {
            decoder.decode(code(window, false));
        }
    }
    assert_eq!(decoder.dropped(), 0);
    assert_eq!(decoder.finish(TIMEOUT).not_decoded, 0);
    assert_eq!(numbers(&count), (1..=5000).collect::<Vec<u32>>());
}

/// Returns a packed block with these bytes; if `bytes` is `None`, the placeholder for a lost block.
/// To make each frame recognisable, its stamp is `index` nanoseconds after 1970.
fn block(index: u32, bytes: Option<Vec<u8>>, is_first: bool) -> TimedPackedBlock {
    TimedPackedBlock {
        block: bytes.map(|bytes| PackedBytes { bytes, rate: 4 }),
        is_first,
        stamp: Stamp::from_nanoseconds(index.into()),
        words: TriWords { window: index, ..TriWords::default() },
    }
}

fn lost_block(index: u32, is_first: bool) -> TimedPackedBlock {
    block(index, None, is_first)
}

#[test]
fn frames_from_codes_and_from_packed_blocks_are_one_stream() {
    let (places, mut decoder) = start();
    decoder.start_device(reconstruction(), Some(unpacked()));
    for index in 0..60 {
        if index % 20 < 10 {
            decoder.decode(code(index, true));
        } else {
            decoder.decode_block(lost_block(index, index % 20 == 10));
        }
        if index % 20 == 19 {
            decoder.finish_blocks();
        }
    }
    assert_eq!(decoder.finish(TIMEOUT).not_decoded, 0);
    let due: Vec<(u32, i64)> = (1..=60).zip(0..).collect();
    assert_eq!(*places.lock().unwrap(), due);
}

#[test]
fn the_frame_that_waits_for_a_correction_is_published_when_another_device_takes_over() {
    let (places, mut decoder) = start();
    for device in 0..2 {
        decoder.start_device(reconstruction(), Some(unpacked()));
        for index in 0..10 {
            decoder.decode_block(lost_block(10 * device + index, false));
        }
    }
    // The frame of the last block is published at the end, without its correction.
    assert_eq!(decoder.finish(TIMEOUT).not_decoded, 0);
    let due: Vec<(u32, i64)> = (1..=20).zip(0..).collect();
    assert_eq!(*places.lock().unwrap(), due);
}

#[test]
fn placeholders_of_packed_blocks_wait_like_blocks() {
    let (places, mut decoder) = start();
    decoder.start_device(reconstruction(), Some(unpacked()));
    for index in 0..4_096 {
        decoder.decode_block(lost_block(index, index == 0));
    }
    assert_eq!(decoder.counts().waiting, 4_096);
    let counts = decoder.finish(TIMEOUT);
    assert_eq!((counts.waiting, counts.not_decoded), (0, 0));
    assert_eq!((counts.decoded, places.lock().unwrap().len()), (0, 4_096));
}

#[test]
fn blocks_that_the_model_does_not_have_are_counted() {
    let (_, mut decoder) = start();
    decoder.start_device(reconstruction(), Some(unpacked()));
    for bytes in [vec![], vec![0x5a; 200]] {
        decoder.decode_block(block(0, Some(bytes), false));
    }
    let counts = decoder.finish(TIMEOUT);
    assert_eq!((counts.decoded, counts.malformed), (1, 1));
    assert!(counts.to_string().ends_with("packed blocks malformed 1"));
}

#[test]
fn an_audit_without_a_code_measures_the_error_of_its_blocks() {
    let model = Arc::new(Model::embedded().unwrap());
    let (_, mut decoder) = start();
    decoder.start_device(reconstruction(), Some(unpacked()));
    // At the start of a run, blocks without bytes decode to signals of 0.
    for window in 0..2 {
        decoder.decode_block(block(window, Some(Vec::new()), window == 0));
    }
    let mut audited = |cell| {
        let window = AuditedWindow {
            device: Arc::new(device(&model)),
            window: 0,
            planes: vec![cell; model.window_cells()],
            levels: Vec::new(),
            resolution: 1,
        };
        decoder.audit(window, Arc::clone(&model));
        decoder.start_work();
        while decoder.progress.audits_waiting.load(Ordering::Relaxed) > 0 {
            std::thread::yield_now();
        }
        decoder.audit_status().unwrap().message
    };
    let expected = "the packed blocks match the device's signals within 0.00 uV RMS";
    assert_eq!(audited(0), expected);
    assert!(audited(127).contains("was not compared"));
}

#[test]
fn every_code_of_a_burst_after_a_stall_is_decoded() {
    let (count, mut decoder) = start();
    decoder.start_device(reconstruction(), None);
    // Queue 37 s of codes at once, faster than the thread can decode them.
    for window in 0..600 {
        decoder.decode(code(window, true));
    }
    let counts = decoder.finish(TIMEOUT);
    assert_eq!((counts.decoded, counts.not_decoded), (600, 0));
    assert_eq!((counts.waiting, count.lock().unwrap().len()), (0, 600));
    assert!(counts.longest_wait > std::time::Duration::ZERO);
}

#[test]
fn codes_are_decoded_only_while_someone_receives_them_and_numbers_continue() {
    let places = Places::default();
    places.is_unused.store(true, Ordering::Relaxed);
    let mut decoder = places.start();
    decoder.start_device(reconstruction(), None);
    for window in 0..20 {
        if window == 10 {
            while decoder.counts().not_needed < 10 {
                std::thread::yield_now();
            }
            places.is_unused.store(false, Ordering::Relaxed);
        }
        decoder.decode(code(window, true));
        decoder.start_work();
    }
    let counts = decoder.finish(TIMEOUT);
    assert_eq!((counts.not_needed, counts.decoded), (10, 10));
    assert_eq!(numbers(&places.frames), (11..=20).collect::<Vec<u32>>());
}

#[test]
fn the_end_does_not_wait_for_a_long_queue_and_counts_what_is_left() {
    let slow = Places { delay: Duration::from_millis(50), ..Places::default() };
    let mut decoder = slow.start();
    decoder.start_device(reconstruction(), None);
    // Queue codes whose frames take the slow sink 60 s.
    for window in 0..1200 {
        decoder.decode(code(window, true));
    }
    let start = Instant::now();
    let counts = decoder.finish(Duration::from_millis(500));
    assert!(start.elapsed() < Duration::from_secs(20));
    assert!(counts.not_decoded > 0 && counts.waiting == 0, "{counts}");
    assert_eq!(counts.decoded + counts.not_decoded, 1200, "{counts}");
}
