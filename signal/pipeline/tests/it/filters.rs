//! The device's filters with their worst-case inputs: no overflow, no limit cycle above one count,
//! decaying offsets.

use fixed_dsp::{CascadeState, Filter, Section};
use model::{GUARD_BITS, SECTIONS};
use pipeline::{Mains, Sample};

const BOTH: [Mains; 2] = [Mains::Hz50, Mains::Hz60];

/// One count in units of a filtered sample (Q27.5).
const COUNT: i32 = 1 << GUARD_BITS;

/// Full scale, the magnitude of the lower rail, in units of a filtered sample.
const FULL_SCALE: f64 = 268_435_456.0;

/// Returns the filters' sections up to and including section `last`.
fn prefix(mains: Mains, last: usize) -> Vec<Section> {
    mains.filter().cascade.sections[..=last].to_vec()
}

/// Returns the full-scale input that yields the largest output after `sections`: the signs of the
/// reversed impulse response, times full scale. That output is the L1 norm of the response times
/// full scale.
fn worst_telegraph(sections: &[Section]) -> Vec<i32> {
    let impulse = std::iter::once(1.0).chain(std::iter::repeat_n(0.0, 20_000));
    let response: Vec<f64> = model_gen::response::filter(sections, impulse).collect();
    response.iter().rev().map(|h| rail(*h >= 0.0)).collect()
}

fn rail(upper: bool) -> i32 {
    if upper { Sample::MAX } else { -Sample::MAX - 1 }
}

/// Filters counts with the fixed-point filters of the device.
fn filtered(mains: Mains, counts: &[i32]) -> Vec<i32> {
    let mut state = CascadeState::REST;
    counts.iter().map(|&count| mains.apply(&mut state, count << GUARD_BITS)).collect()
}

/// Filters counts in f64: quantised coefficients, no rounding of the signal, no overflow.
fn float_twin(mains: Mains, counts: &[i32]) -> Vec<f64> {
    let input = counts.iter().map(|&count| f64::from(count << GUARD_BITS));
    model_gen::response::filter(&mains.filter().cascade.sections, input).collect()
}

/// Returns the largest absolute difference between the fixed-point and the float output, and the
/// largest magnitude of the fixed-point output, both in LSBs of a filtered sample (1/32 count).
fn distance(mains: Mains, counts: &[i32]) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    for (y, expected) in filtered(mains, counts).into_iter().zip(float_twin(mains, counts)) {
        largest[0] = largest[0].max((f64::from(y) - expected).abs());
        largest[1] = largest[1].max(f64::from(y).abs());
    }
    largest
}

/// Returns the worst-case gain of the output, as proven when the model is built.
fn proven_gain(mains: Mains) -> f64 {
    let gains = model_gen::headroom::prove_cascade(&prefix(mains, SECTIONS - 1));
    gains.expect("also proven at build time").last().expect("a cascade has nodes").gain
}

/// Limit of the shaped rounding noise of six sections, in units of a filtered sample (largest
/// measured: 15). A wrap at any node would cause an error of millions.
const NOISE: f64 = 128.0;

#[test]
fn the_worst_full_scale_input_of_every_section_never_wraps() {
    for mains in BOTH {
        for last in 0..SECTIONS {
            let [error, _] = distance(mains, &worst_telegraph(&prefix(mains, last)));
            assert!(error < NOISE, "error of {error} / {COUNT} counts");
        }
    }
}

#[test]
fn the_output_s_worst_input_reaches_the_proven_gain() {
    for mains in BOTH {
        let [_, largest] = distance(mains, &worst_telegraph(&prefix(mains, SECTIONS - 1)));
        let (reached, proven) = (largest / FULL_SCALE, proven_gain(mains));
        println!("{mains:?}: worst gain proven {proven:.4}, reached {reached:.4}");
        assert!((reached / proven - 1.0).abs() < 1e-3);
    }
}

#[test]
fn telegraphs_from_rail_to_rail_stay_below_the_proven_gain() {
    // Square waves and random telegraph signals between +-187.5 mV, with half periods or mean
    // durations from 5 s down to one sample.
    for mains in BOTH {
        let mut largest_gain = 0.0_f64;
        let mut random = 1_u32;
        for half_period in [2_560, 512, 128, 51, 32, 13, 8, 5, 4, 3, 2, 1] {
            let square: Vec<i32> = (0..20_480).map(|n| rail((n / half_period) % 2 == 0)).collect();
            let mut upper = true;
            let telegraph: Vec<i32> = (0..20_480)
                .map(|_| {
                    random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    upper ^= random < u32::MAX / half_period;
                    rail(upper)
                })
                .collect();
            for counts in [square, telegraph] {
                let [error, largest] = distance(mains, &counts);
                assert!(error < NOISE, "error of {error} / {COUNT} counts");
                largest_gain = largest_gain.max(largest / FULL_SCALE);
            }
        }
        let proven = proven_gain(mains);
        println!("{mains:?}: telegraphs reach a gain of {largest_gain:.4}, proven {proven:.4}");
        assert!(largest_gain > 1.0 && largest_gain <= proven);
    }
}

#[test]
fn zeros_after_a_signal_leave_no_limit_cycle_above_one_count() {
    for mains in BOTH {
        let mut largest = 0;
        for amplitude in [1, 100, 44_739, 894_784, Sample::MAX] {
            for period in [1, 3, 10, 51, 512, 4_096] {
                // A square wave of 4 s, then 60 s of zeros; the last 10 s are checked.
                let signal =
                    (0..2_048).map(|n| if (n / period) % 2 == 0 { amplitude } else { -amplitude });
                let counts: Vec<i32> = signal.chain(std::iter::repeat_n(0, 60 * 512)).collect();
                let tail = filtered(mains, &counts).into_iter().rev().take(5_120);
                largest = largest.max(tail.map(i32::abs).max().expect("a tail"));
            }
        }
        println!("{mains:?}: limit cycle of at most {largest} / {COUNT} counts");
        assert!(largest <= COUNT);
    }
}

#[test]
fn an_offset_of_full_scale_decays_below_one_count() {
    for mains in BOTH {
        let output = filtered(mains, &vec![Sample::MAX; 160 * 512]);
        assert!(output[output.len() - 512..].iter().all(|y| y.abs() < COUNT));
    }
}
