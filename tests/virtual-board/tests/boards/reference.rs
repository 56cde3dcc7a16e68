//! Scenario in which a board's codes must equal those of the batch reference in `model-gen`, for a
//! model that is read at run time.

use std::collections::VecDeque;

use artifact::Artifact;
use link::{AckResult, Decoder, ExclusionPolicy, MAX_FRAME, Streams, ToDevice, ToHost};
use model_gen::DeviceModel;
use model_gen::front_end::{Filters, Resampler};
use virtual_board::{BoardError, ReceivedCode, electrode_count};

use crate::codes::received;
use crate::images::Subject;
use crate::session::{answer, assert_sound, in_time, run_codes, running, start, worst_path};

/// Number of codes to compare, three seconds.
const CODES: usize = 48;

/// Mains frequency, in Hz, that a device's filters suppress after start-up.
const MAINS_HZ: u32 = 50;

/// Scenario: the codes of an image with its own model equal the batch reference's bit for bit, they
/// come every 62.5 ms to within a sample, and nothing is late or lost.
pub(crate) fn codes_equal_those_of_the_reference(subject: Subject) -> Result<(), BoardError> {
    let model = DeviceModel::new(&subject.artifact()).expect("a model for a device");
    let mut board = running(subject)?;
    // The device may find the synthetic signals bad, but the reference excludes no electrode.
    let none = ExclusionPolicy { automatic: false, ..ExclusionPolicy::AUTOMATIC };
    let answered = answer(&mut board, &ToDevice::SetExclusion(none))?;
    assert_eq!(answered == AckResult::Done, model.substitution.is_some());
    let before = board.converters().samples_delivered();
    assert_eq!(start(&mut board, Streams::CODES)?, AckResult::Done);
    let after = board.converters().samples_delivered();
    run_codes(&mut board, CODES)?;

    let codes = received(board.inbox().frames());
    let made: Vec<_> = codes.iter().map(levels).collect();
    let mut first = before.saturating_sub(1)..=after + 1;
    let equal = first.find(|&sample| expected(&model, sample, 1) == made[..1]);
    let first = equal.expect("the first code equals none of the reference's");
    for (number, (made, expected)) in (0..).zip(made.iter().zip(expected(&model, first, CODES))) {
        assert_eq!(*made, expected, "code {number}");
    }
    let varies = made.windows(2).filter(|codes| codes[0] != codes[1]).count();
    assert!(varies > CODES / 2, "{varies} codes differ from the one before");

    // A fast clock of the converters shortens the time from one code to the next.
    let converters = subject.converters();
    let rate_hz = u64::from(converters.rate_hz);
    let nominal_hz = if rate_hz.is_power_of_two() { 1 << 21 } else { 2_048_000 };
    let interval_us = |codes: u64| codes * 62_500 * nominal_hz / u64::from(converters.clock_hz);
    let period_us = 1_000_000 / rate_hz;
    let stamps = board.inbox().codes().map(|(frame, _)| frame.device_us);
    let stamps: Vec<u64> = stamps.collect();
    for (index, stamp) in (0..).zip(&stamps) {
        let error_us = (stamp - stamps[0]).abs_diff(interval_us(index));
        assert!(error_us <= period_us, "code {index} is {error_us} us off");
    }
    let worst = worst_path(&in_time(&board));
    subject.record("equal_to_reference", made.len());
    subject.record("worst_path_over_deadline", format!("{worst:.3}"));
    assert_sound(&mut board)
}

/// Decodes a received code and returns its quantised values (levels).
fn levels(code: &ReceivedCode) -> Vec<i32> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let frame = decoder.next::<ToHost<'_>>(&mut &code.bytes[..]);
    match frame.expect("a frame").expect("a sound frame").message {
        ToHost::Code(code) => code.values.levels().collect(),
        other => panic!("{other:?} is no code"),
    }
}

/// Returns the levels that the batch reference computes for the first `codes` codes of a stream
/// that starts with sample number `first`.
fn expected(model: &DeviceModel, first: u64, codes: usize) -> Vec<Vec<i32>> {
    let description = &model.description;
    let dimensions = description.dimensions();
    let mut filters = Filters::new(description, MAINS_HZ).expect("usual filters");
    let mut resampler = Resampler::new(description).expect("a usual rate");
    let mut window = VecDeque::new();
    let (mut steps, mut made) = (0, Vec::new());
    for sample in first.. {
        let counts = (0..dimensions.electrodes).map(|channel| electrode_count(sample, channel));
        let filtered = filters.filter_sample(&counts.collect::<Vec<_>>());
        let Some(step) = resampler.resample(filtered) else {
            continue;
        };
        window.extend(plane(model, &step));
        steps += 1;
        if steps < dimensions.steps {
            continue;
        }
        if (steps - dimensions.steps).is_multiple_of(description.window.hop) {
            let code = model.integers.encode_window(window.make_contiguous());
            made.push(code.levels());
            if made.len() == codes {
                break;
            }
        }
        window.drain(..dimensions.cells());
    }
    made
}

/// Returns the network's input levels for a filtered step, arranged on the scalp grid.
fn plane(model: &DeviceModel, step: &[i32]) -> Vec<i8> {
    let mut plane = vec![0; model.description.dimensions().cells()];
    for (&value, &cell) in step.iter().zip(&model.integers.cells) {
        let product = i64::from(value) * i64::from(model.input_multiplier);
        // Round the Q32 product half up.
        let level = ((product + (1 << 31)) >> 32).clamp(-128, 127);
        plane[usize::from(cell)] = i8::try_from(level).expect("clamped");
    }
    plane
}

impl Subject {
    /// Returns the model of the image.
    fn artifact(self) -> Artifact {
        let folder = self.model_folder().expect("an image with another model");
        Artifact::read(&folder).unwrap_or_else(|error| panic!("{error}"))
    }
}
