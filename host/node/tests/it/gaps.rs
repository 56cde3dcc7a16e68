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
    let acquisition = acquisition();
    let mut harness = Harness::new(&acquisition.frame(0));
    harness.receive_all(&acquisition, 1..40);
    assert_eq!(harness.status("corticode: loss").level, DiagnosticLevel::Ok);
    // Frames 40 to 44 are lost; a frame lasts one hop.
    let arrival = harness.receive(&acquisition.frame(45), 6 * FRAME_US);
    assert_eq!(arrival.unwrap(), Arrival::Lost(5));
    harness.receive_all(&acquisition, 46..80);
    let frames = &harness.recorder.encoded;
    let windows: Vec<i32> = frames.iter().map(|frame| word(frame, "seq_lo")).collect();
    assert!(
        windows.windows(2).all(|pair| pair[1] == pair[0] + 1),
        "{windows:?}"
    );
    let fillers: Vec<i32> = frames
        .iter()
        .filter(|frame| is_filler(frame))
        .map(|frame| word(frame, "seq_lo"))
        .collect();
    // A window has two hops, and five hops are lost after hop 39. The first step after the gap is
    // made of samples since the step before it, which are lost, so the hop after the gap is lost
    // too.
    let hops = i32::try_from(model::STEPS / model::HOP).unwrap();
    let first = 40 - (hops - 1);
    let expected: Vec<i32> = (first..=45).collect();
    assert_eq!(fillers, expected);
    let last = frames.last().unwrap();
    assert_eq!(usize::try_from(word(last, "lost")), Ok(expected.len()));
    let loss = harness.status("corticode: loss");
    assert_eq!(loss.level, DiagnosticLevel::Warn, "{}", loss.message);
    assert_eq!(harness.source.counts().lost, 5);
    // Up to the gap, all codes are those of a recording without a gap.
    let expected = acquisition.codes_of_recording(40, Mains::Hz50);
    let frames = harness.recorder.encoded.iter().zip(&expected);
    for (frame, code) in frames.take(usize::try_from(first).unwrap()) {
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
    // The 2 s without frames are 32 codes; window 0 also needs the first two hops of the new run.
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
