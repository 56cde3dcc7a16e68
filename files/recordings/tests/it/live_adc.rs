//! Tests that live samples yield the same counts as a recording of these samples.

use std::io::Cursor;

use recordings::{AdcSpec, FileToWrite, GdfWriter, LiveAdc, Missing, MontageMap};

use crate::{open, played};

/// Montage of the test. The source lacks Fz, which is interpolated from the other electrodes.
const MONTAGE: [&str; 4] = ["Cz", "Fz", "Pz", "C3"];
/// Labels of the source; their order and spelling differ from the montage. The montage does not
/// contain EMG.
const LABELS: [&str; 4] = ["PZ.", "EMG", "c3", "Cz"];
const SECONDS: u32 = 6;

/// Returns samples of the source in uV: pseudo-random noise on an offset.
fn samples(rate_hz: u32) -> Vec<f32> {
    let mut state = 1_u32;
    let values = (0..rate_hz * SECONDS).flat_map(|_| [0.0_f32, 1.0, 2.0, 3.0]);
    values
        .map(|offset| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f32::from(u16::try_from(state >> 16).expect("16 bits")) / 300.0;
            1000.0 * offset + noise
        })
        .collect()
}

fn recorded(rate_hz: u32, samples: &[f32]) -> Vec<[i32; 64]> {
    let file = FileToWrite::microvolts(LABELS, [-187_500.0, 187_500.0], rate_hz, rate_hz);
    let mut writer = GdfWriter::new(Cursor::new(Vec::new()), &file).expect("a header");
    for record in samples.chunks(rate_hz as usize * LABELS.len()) {
        writer.write_record(record).expect("memory");
    }
    let bytes = writer.finish(&[]).expect("memory").into_inner();
    let recording = open(bytes).expect("a valid file");
    let adc = played(recording, &MONTAGE, Missing::Interpolate);
    adc.collect::<Result<_, _>>().expect("readable")
}

#[test]
fn counts_are_those_of_a_recording_and_come_with_the_frame_after_the_delay() {
    for rate_hz in [128, 250, 256, 500, 512, 1000, 1024, 2000, 5000] {
        // A chunk has 2 to 35 rows; only some of these numbers divide the number of rows in a
        // second.
        let rows = rate_hz as usize % 37 + 1;
        let samples = samples(rate_hz);
        let expected = recorded(rate_hz, &samples);
        let map = MontageMap::new(&LABELS, &MONTAGE, Missing::Interpolate).expect("a montage");
        let mut adc = LiveAdc::new(&LABELS, rate_hz, &map, AdcSpec::ads1299(512)).expect("usable");
        let (mut counts, mut appended) = (Vec::new(), 0);
        for frame in samples.chunks(rows * LABELS.len()) {
            adc.append(frame);
            counts.extend(std::iter::from_fn(|| adc.next_sample()));
            // No sample waits longer than the delay: the counts reach up to the newest sample of
            // the source, less the delay.
            appended += frame.len() / LABELS.len();
            let reached = appended.saturating_sub(adc.delay());
            assert_eq!(counts.len(), (reached * 512).div_ceil(rate_hz as usize), "{rate_hz} Hz");
        }
        assert_eq!(counts, expected[..counts.len()], "{rate_hz} Hz");
    }
}

#[test]
fn lost_samples_are_held_so_that_later_samples_keep_their_time() {
    let map = MontageMap::new(&["Cz"], &["Cz"], Missing::Refuse).expect("a montage");
    let mut adc = LiveAdc::new(&["Cz"], 512, &map, AdcSpec::ads1299(512)).expect("usable");
    adc.append(&[0.0, 100.0]);
    adc.hold(2);
    adc.append(&[f32::NAN, -100.0]);
    let counts: Vec<i32> = std::iter::from_fn(|| adc.next_sample().map(|all| all[0])).collect();
    // 100 uV is repeated three times; the first and the third repetition get one count of dither.
    assert_eq!(counts, [0, 4474, 4475, 4474, 4475, -4474]);
    assert_eq!(adc.counters().not_finite, 1);
}
