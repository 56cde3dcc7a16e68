//! Tests of the resampler: its design compared with scipy's, its phases, and the rates that it
//! refuses. `scipy_firwin.py` in this folder printed the golden numbers.

use artifact::Decimation;
use model_gen::{
    FilterError, ResamplerTable,
    resampler::{CUTOFF_HZ, KAISER_BETA, UNITY, kaiser_low_pass},
};

const GOLDEN: &str = include_str!("scipy_firwin.csv");

/// Usual sampling rates of EEG amplifiers, Hz.
const RATES: [u32; 6] = [250, 256, 500, 512, 1_000, 1_024];

/// Iterates over the lines of the golden file: rate in Hz, number of phases, total number of taps
/// over all phases, index of a tap, value of the tap.
fn golden() -> impl Iterator<Item = (u32, usize, usize, usize, f64)> {
    GOLDEN.lines().filter(|line| !line.starts_with('#')).map(|line| {
        let mut columns = line.split(',');
        let mut integer = || -> usize {
            let column = columns.next().expect("five columns");
            column.parse().expect("the golden file holds numbers")
        };
        let (rate, phases, taps, index) = (integer(), integer(), integer(), integer());
        let value = columns.next().expect("five columns");
        let value = value.parse().expect("the golden file holds numbers");
        let rate = u32::try_from(rate).expect("a rate");
        (rate, phases, taps, index, value)
    })
}

fn fir(rate_hz: u32) -> Result<ResamplerTable, FilterError> {
    ResamplerTable::new(Decimation::Fir, rate_hz, 128, 61)
}

#[test]
fn the_low_pass_equals_scipy_s_to_1e_12() {
    let mut rates = std::collections::BTreeSet::new();
    for (rate, phases, taps, index, expected) in golden() {
        rates.insert(rate);
        #[expect(clippy::cast_precision_loss, reason = "phases <= 64")]
        let high_rate = f64::from(rate) * phases as f64;
        let found = kaiser_low_pass(taps, CUTOFF_HZ, KAISER_BETA, high_rate)[index];
        // The largest measured difference from scipy is 3e-17.
        assert!((found - expected).abs() < 1e-12, "tap {index} at {rate} Hz: {found} {expected}");
    }
    assert!(rates.into_iter().eq(RATES));
}

#[test]
fn the_quantised_low_pass_has_scipy_s_taps_up_to_the_gain_of_each_phase() {
    for (rate, phases, taps, index, expected) in golden() {
        let table = fir(rate).expect("a usual rate");
        assert_eq!((table.phases(), table.phases() * table.taps_per_phase()), (phases, taps));
        let found = table.prototype()[index];
        // At 250 Hz, one of the 64 phases has a gain of 1.0002 before normalisation. Normalisation
        // changes the phase's largest tap, 0.5 / 64, by 1.6e-6, the largest measured difference.
        assert!((found - expected).abs() < 3e-6, "tap {index} at {rate} Hz: {found} {expected}");
    }
}

#[test]
fn a_constant_passes_every_phase_of_every_rate_unchanged_and_no_sum_overflows() {
    let mut refused = 0;
    for rate in 134..=2_144 {
        match fir(rate) {
            Ok(table) => {
                for taps in &table.taps {
                    assert_eq!(taps.iter().map(|&t| i64::from(t)).sum::<i64>(), i64::from(UNITY));
                }
                assert!(usize::from(table.down) >= table.phases());
                assert!(table.largest_magnitude() < 1 << 31);
            }
            Err(FilterError::ResamplerSize { .. }) => refused += 1,
            Err(error) => panic!("{rate} Hz: {error}"),
        }
    }
    // Above 1024 Hz, odd rates need 128 phases of more than 128 taps, which exceed the memory
    // limit. Above 2048 Hz, rates with 64 phases exceed it, too.
    assert!(refused > 500, "{refused}");
}

#[test]
fn the_ratio_is_in_lowest_terms() {
    let terms = |rate| fir(rate).map(|table| (table.phases(), table.down, table.taps_per_phase()));
    assert_eq!(terms(250), Ok((64, 125, 32)));
    assert_eq!(terms(256), Ok((1, 2, 32)));
    assert_eq!(terms(500), Ok((32, 125, 64)));
    assert_eq!(terms(512), Ok((1, 4, 64)));
    assert_eq!(terms(1_000), Ok((16, 125, 128)));
    assert_eq!(terms(1_024), Ok((1, 8, 128)));
}

#[test]
fn literal_decimation_has_a_single_tap_of_one() {
    for rate in [128, 256, 512, 1_024] {
        let table = ResamplerTable::new(Decimation::Literal, rate, 128, 61).expect("a multiple");
        assert_eq!(u32::from(table.down), rate / 128);
        assert_eq!(table.taps, [[UNITY]]);
    }
}

#[test]
fn the_error_of_an_impossible_rate_states_number_and_remedy() {
    for (decimation, rate, parts) in [
        (Decimation::Literal, 500, ["500 Hz is not a multiple of 128 Hz", "\"fir\"", "512 Hz"]),
        (Decimation::Fir, 100, ["100 samples a second", "at least 128", ""]),
        (Decimation::Literal, 0, ["at least 128", "", ""]),
        // A delay line of 61 electrodes x 272 taps x 4 bytes exceeds the limit of 65536 bytes.
        (Decimation::Fir, 2_176, ["66368 B, more than 65536", "61 electrodes", ""]),
        (Decimation::Fir, 1_025, ["128 phases of 132 taps", "", ""]),
        // 133 Hz is so close to the step rate of 128 Hz that the taps of a phase hardly decay:
        // their magnitudes sum to 2 or more, which the accumulator does not allow.
        (Decimation::Fir, 133, ["from 133 Hz add up to", "", ""]),
        (Decimation::Fir, 9_999_999, ["65536", "", ""]),
    ] {
        let error = ResamplerTable::new(decimation, rate, 128, 61).expect_err("impossible");
        let error = error.to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
    }
}
