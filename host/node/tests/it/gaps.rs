//! Lost frames and restarts of the acquisition.

use neuro_ros::DiagnosticLevel;
use node::Arrival;
use pipeline::Mains;

use crate::acquisition::Acquisition;
use crate::harness::{Harness, is_filler, word};

const FRAME_US: i64 = 62_500;

fn acquisition() -> Acquisition {
    Acquisition::new(model::ADC_RATE_HZ, model::ADC_RATE_HZ / 16)
}

#[test]
fn codes_next_to_lost_frames_are_fillers_and_counted_and_later_ones_keep_their_index() {
    // A frame lasts one hop.
    for rate_hz in [model::ADC_RATE_HZ, 2000] {
        lose_frames(&Acquisition::new(rate_hz, rate_hz / 16));
    }
}

fn lose_frames(acquisition: &Acquisition) {
    let mut harness = Harness::new(&acquisition.frame(0));
    harness.receive_all(acquisition, 1..40);
    assert_eq!(harness.status("corticode: loss").level, DiagnosticLevel::Ok);
    // Frames 40 to 44 are lost.
    let arrival = harness.receive(&acquisition.frame(45), 6 * FRAME_US);
    assert_eq!(arrival.unwrap(), Arrival::Lost(5));
    harness.receive_all(acquisition, 46..80);
    let frames = &harness.recorder.encoded;
    let windows: Vec<i32> = frames.iter().map(|frame| word(frame, "seq_lo")).collect();
    assert!(windows.windows(2).all(|pair| pair[1] == pair[0] + 1), "{windows:?}");
    let fillers: Vec<i32> =
        frames.iter().filter(|frame| is_filler(frame)).map(|frame| word(frame, "seq_lo")).collect();
    // A window has two hops, and five hops are lost after hop 39. The first step after the gap
    // depends on lost samples, so the hop after the gap is lost too.
    let hops = i32::try_from(model::STEPS / model::HOP).unwrap();
    let first = 40 - (hops - 1);
    let expected: Vec<i32> = (first..=45).collect();
    assert_eq!(fillers, expected);
    let last = frames.last().unwrap();
    assert_eq!(usize::try_from(word(last, "lost")), Ok(expected.len()));
    let loss = harness.status("corticode: loss");
    assert_eq!(loss.level, DiagnosticLevel::Warn, "{}", loss.message);
    assert_eq!(harness.source.counts().lost, 5);
    // Up to the gap, all codes equal those of a recording without a gap. The code before the
    // fillers is an exception if the resampler's filter reaches from the code's end into the gap.
    let same = first - i32::from(harness.source.delay_us() > 0);
    let expected = acquisition.codes_of_recording(40, Mains::Hz50);
    let frames = harness.recorder.encoded.iter().zip(&expected);
    for (frame, code) in frames.take(usize::try_from(same).unwrap()) {
        assert_eq!(&frame.eeg.data, code);
    }
}

#[test]
fn an_acquisition_that_counts_from_1_again_is_a_restart_as_of_a_board() {
    let acquisition = acquisition();
    let mut harness = Harness::new(&acquisition.frame(0));
    harness.receive_all(&acquisition, 1..40);
    let before = harness.recorder.encoded.len();
    let arrival = harness.receive(&acquisition.frame(0), 2_000_000);
    assert_eq!(arrival.unwrap(), Arrival::Restarted);
    harness.receive_all(&acquisition, 1..40);
    assert_eq!(harness.source.counts().restarts, 1);
    let expected = acquisition.codes_of_recording(40, Mains::Hz50);
    let after = &harness.recorder.encoded[before..];
    let fillers = after.iter().filter(|frame| is_filler(frame)).count();
    // The 2 s without frames correspond to 32 codes. Window 0 after the restart also needs the
    // first two hops after the restart.
    assert!((30..=34).contains(&fillers), "{fillers} fillers");
    let codes: Vec<_> = after.iter().filter(|frame| !is_filler(frame)).collect();
    assert_eq!(codes.len(), expected.len());
    for (frame, code) in codes.iter().zip(&expected) {
        assert_eq!(&frame.eeg.data, code);
    }
    let announced = harness.recorder.announced.len();
    assert!((1..=2).contains(&announced), "announced {announced} times");
}

#[test]
fn a_refused_frame_is_a_lost_one_when_the_next_comes() {
    let acquisition = acquisition();
    let mut harness = Harness::new(&acquisition.frame(0));
    harness.receive_all(&acquisition, 1..10);
    let mut broken = acquisition.frame(10);
    broken.eeg.data[70] = f32::NAN;
    harness.receive(&broken, FRAME_US).unwrap_err();
    let arrival = harness.receive(&acquisition.frame(11), FRAME_US);
    assert_eq!(arrival.unwrap(), Arrival::Lost(1));
}

/// Arrivals of frames, with a standstill before frame 40.
struct Standstill {
    name: &'static str,
    /// Rate of the acquisition, Hz.
    rate_hz: u16,
    /// Times from the previous frame to frames 40, 41, 42 and so on, microseconds. All later frames
    /// follow after one frame's duration.
    late: Vec<i64>,
    /// Number of frames lost before frame 40.
    lost: u32,
    is_numbered: bool,
    /// Length of the pause, microseconds; 0 if the frames have waited in a buffer.
    pause_us: i64,
}

#[test]
fn a_standstill_without_a_lost_frame_fills_nothing_and_stamps_follow_a_pause_only() {
    let rate = model::ADC_RATE_HZ;
    let pause = vec![5_000_000 + FRAME_US];
    // 82 frames wait in a buffer, the first for 5 s, and come within 81 ms; then one is on time.
    let mut buffered = vec![5_000_000 + FRAME_US];
    buffered.extend([1_000; 81]);
    buffered.push(2 * FRAME_US - 81_000);
    let case = |name, rate_hz, late: &[i64], pause_us| Standstill {
        name,
        rate_hz,
        late: late.to_vec(),
        lost: 0,
        is_numbered: true,
        pause_us,
    };
    let unnumbered = Standstill {
        is_numbered: false,
        ..case("a pause of frames without numbers", rate, &pause, 5_000_000)
    };
    let lossy = Standstill {
        lost: 16,
        ..case("a pause of 4 s, and 1 s of lost frames", rate, &pause, 4_000_000)
    };
    for standstill in [
        case("a pause", rate, &pause, 5_000_000),
        case("a pause of 0.4 s", rate, &[400_000 + FRAME_US], 400_000),
        case("a pause, resampled", 250, &[5_060_000], 5_000_000),
        case("a backlog", rate, &buffered, 0),
        unnumbered,
        lossy,
    ] {
        check_standstill(&standstill);
    }
}

fn check_standstill(standstill: &Standstill) {
    let name = standstill.name;
    let acquisition = Acquisition::new(standstill.rate_hz, standstill.rate_hz / 16);
    let frame_us = 1_000_000 * i64::from(acquisition.samples) / i64::from(acquisition.rate_hz);
    let frame = |index: u32| {
        let mut frame = acquisition.frame(index);
        if !standstill.is_numbered {
            frame.neuroheader.seq = 0;
        }
        frame
    };
    let frames = 400_u32;
    let mut harness = Harness::new(&frame(0));
    for index in 1..frames {
        let late = index.checked_sub(40).and_then(|place| standstill.late.get(place as usize));
        let index = index + if index < 40 { 0 } else { standstill.lost };
        harness.receive(&frame(index), *late.unwrap_or(&frame_us)).unwrap();
    }
    let counts = harness.source.counts();
    let pauses = u64::from(standstill.pause_us > 0);
    assert_eq!((counts.pauses, counts.restarts), (pauses, 0), "{name}");
    assert!(
        counts.paused_us.abs_diff(standstill.pause_us.unsigned_abs()) < 1_000,
        "{name}: {counts:?}"
    );
    let encoded = &harness.recorder.encoded;
    let fillers = encoded.iter().filter(|frame| is_filler(frame)).count();
    let expected = if standstill.lost > 0 { standstill.lost as usize + 2 } else { 0 };
    assert_eq!(fillers, expected, "{name}");
    // Successive stamps are 62.5 ms apart, as the samples are, except at the pause.
    let stamp_us = |frame: &neuro_ros::NeuroFrame| frame.header.stamp.nanoseconds() / 1000;
    let first = stamp_us(&encoded[0]);
    let steps = encoded.windows(2).map(|pair| stamp_us(&pair[1]) - stamp_us(&pair[0]));
    let jumps: Vec<i64> = steps.filter(|step| (step - FRAME_US).abs() > 1_000).collect();
    let codes = i64::try_from(encoded.len()).unwrap() - 1;
    let drift = stamp_us(encoded.last().unwrap()) - first - codes * FRAME_US;
    assert!((drift - standstill.pause_us).abs() < 1_000, "{name}: {drift} us, {jumps:?}");
    assert!(jumps.len() <= 2, "{name}: {jumps:?}");
}
