//! What the device's filters promise, played with the inputs that would break it: no overflow, no
//! limit cycle, offsets that go away.

use fixed_dsp::{CascadeState, Filter, Section};
use model::{GUARD_BITS, SECTIONS};
use pipeline::{Mains, Sample};

const BOTH: [Mains; 2] = [Mains::Hz50, Mains::Hz60];

/// One count in steps of a filtered sample.
const COUNT: i32 = 1 << GUARD_BITS;

/// The lower rail, in steps of a filtered sample: full scale.
const FULL_SCALE: f64 = 268_435_456.0;

/// Sections up to and including `last`.
fn prefix(mains: Mains, last: usize) -> Vec<Section> {
    mains.filter().cascade.sections[..=last].to_vec()
}

/// The full-scale input that drives the output of the last of `sections` furthest: the sign pattern
/// of the reversed impulse response. No other input reaches the L1 norm.
fn worst_telegraph(sections: &[Section]) -> Vec<i32> {
    let impulse = std::iter::once(1.0).chain(std::iter::repeat_n(0.0, 20_000));
    let response: Vec<f64> = model_gen::response::filter(sections, impulse).collect();
    response.iter().rev().map(|h| rail(*h >= 0.0)).collect()
}

/// A count at the upper or the lower rail.
fn rail(upper: bool) -> i32 {
    if upper { Sample::MAX } else { -Sample::MAX - 1 }
}

/// The filtered counts, by the filters that run on the device.
fn filtered(mains: Mains, counts: &[i32]) -> Vec<i32> {
    let mut state = CascadeState::REST;
    counts
        .iter()
        .map(|&count| mains.step(&mut state, count << GUARD_BITS))
        .collect()
}

/// The same in f64: quantised coefficients, no rounding of the signal, no overflow.
fn float_twin(mains: Mains, counts: &[i32]) -> Vec<f64> {
    let input = counts.iter().map(|&count| f64::from(count << GUARD_BITS));
    model_gen::response::filter(&mains.filter().cascade.sections, input).collect()
}

/// Largest distance of the fixed-point output from the float one, and largest output.
fn distance(mains: Mains, counts: &[i32]) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    for (y, expected) in filtered(mains, counts)
        .into_iter()
        .zip(float_twin(mains, counts))
    {
        largest[0] = largest[0].max((f64::from(y) - expected).abs());
        largest[1] = largest[1].max(f64::from(y).abs());
    }
    largest
}

/// The output's worst-case gain, as proven when the model was built.
fn proven_gain(mains: Mains) -> f64 {
    let gains = model_gen::headroom::prove(&prefix(mains, SECTIONS - 1));
    gains
        .expect("proven at build time too")
        .last()
        .expect("a cascade has nodes")
        .gain
}

/// Shaped rounding noise of six sections, in steps (measured: 15); a wrap anywhere would be off by
/// millions.
const NOISE: f64 = 128.0;

#[test]
fn the_worst_full_scale_input_of_every_section_never_wraps() {
    for mains in BOTH {
        for last in 0..SECTIONS {
            let [error, _] = distance(mains, &worst_telegraph(&prefix(mains, last)));
            assert!(error < NOISE, "off by {error} steps");
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
    // Square waves from one period per 10 s to every sample, and random telegraphs of ever shorter
    // mean duration: 187.5 mV either way.
    for mains in BOTH {
        let mut largest_gain = 0.0_f64;
        let mut random = 1_u32;
        for half_period in [2_560, 512, 128, 51, 32, 13, 8, 5, 4, 3, 2, 1] {
            let square: Vec<i32> = (0..20_480)
                .map(|n| rail((n / half_period) % 2 == 0))
                .collect();
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
                assert!(error < NOISE, "off by {error} steps");
                largest_gain = largest_gain.max(largest / FULL_SCALE);
            }
        }
        let proven = proven_gain(mains);
        println!("{mains:?}: telegraphs reach a gain of {largest_gain:.4}, proven {proven:.4}");
        assert!(largest_gain > 1.0 && largest_gain <= proven);
    }
}

#[test]
fn silence_after_a_signal_leaves_no_limit_cycle_above_one_count() {
    for mains in BOTH {
        let mut largest = 0;
        for amplitude in [1, 100, 44_739, 894_784, Sample::MAX] {
            for period in [1, 3, 10, 51, 512, 4_096] {
                // A signal of 4 s, then 60 s of zeros, of which the last 10 are looked at.
                let signal = (0..2_048).map(|n| {
                    if (n / period) % 2 == 0 {
                        amplitude
                    } else {
                        -amplitude
                    }
                });
                let counts: Vec<i32> = signal.chain(std::iter::repeat_n(0, 60 * 512)).collect();
                let tail = filtered(mains, &counts).into_iter().rev().take(5_120);
                largest = largest.max(tail.map(i32::abs).max().expect("a tail"));
            }
        }
        println!("{mains:?}: limit cycle of at most {largest} of {COUNT} steps of a count");
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
