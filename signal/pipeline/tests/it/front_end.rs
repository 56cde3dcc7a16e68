//! The front end at every sampling rate and decimation. The tests compare it with a front end whose
//! sizes are known only at run time, and with scipy's double-precision filters. They also measure
//! the aliases of tones above half of the step rate, and the group delay.

use std::f64::consts::PI;

use artifact::{Artifact, Decimation};
use fixed_dsp::{Cascade, Resampler};
use model::{CHANNELS, GUARD_BITS, LSB_NV, SECTIONS};
use model_gen::front_end::{Filters, Resampler as AnyResampler};
use model_gen::{Chain, FilterSpec, ResamplerTable, cascade};
use pipeline::{FrontEnd, Sample};

/// Step rate of every front end in these tests, Hz.
const STEP_RATE_HZ: u32 = 128;

/// The device's filters and resampler, designed and quantised at run time for any ADC rate.
struct AtRate {
    rate_hz: u32,
    cascade: Cascade<SECTIONS>,
    table: ResamplerTable,
}

impl AtRate {
    fn new(rate_hz: u32, mains_hz: u32, decimation: Decimation) -> Self {
        let spec = FilterSpec {
            rate_hz: rate_hz.into(),
            mains_hz: mains_hz.into(),
            harmonics: 0,
            notch_q: 30.0,
            band_hz: [0.5, 60.0],
            order: 5,
        };
        let sections = cascade(&spec).expect("the specification is realisable");
        Self {
            rate_hz,
            cascade: Cascade { sections: sections.try_into().expect("a notch and five sections") },
            table: ResamplerTable::new(decimation, rate_hz, STEP_RATE_HZ, model::ELECTRODES)
                .expect("a sane rate"),
        }
    }

    /// Returns filters and resampler as a chain, which computes their response in float.
    fn chain(&self) -> Chain<'_> {
        Chain { sections: &self.cascade.sections, resampler: &self.table, rate_hz: self.rate_hz }
    }

    /// Returns the filtered steps of one electrode, in counts, for an input of `counts`.
    fn steps(&self, counts: &[i32]) -> Vec<f64> {
        match (self.table.phases(), self.table.taps_per_phase()) {
            (1, 1) => self.run::<1, 1>(counts),
            (64, 32) => self.run::<64, 32>(counts),
            (1, 32) => self.run::<1, 32>(counts),
            (32, 64) => self.run::<32, 64>(counts),
            (1, 64) => self.run::<1, 64>(counts),
            (16, 128) => self.run::<16, 128>(counts),
            (1, 128) => self.run::<1, 128>(counts),
            (phases, taps) => panic!("no front end of {phases} phases and {taps} taps here"),
        }
    }

    fn run<const PHASES: usize, const TAPS: usize>(&self, counts: &[i32]) -> Vec<f64> {
        let rows = self.table.taps.iter().map(|row| {
            let row: [i32; TAPS] = row.as_slice().try_into().expect("TAPS taps");
            row
        });
        let rows: Vec<[i32; TAPS]> = rows.collect();
        let resampler =
            Resampler { down: self.table.down, taps: rows.try_into().expect("PHASES phases") };
        assert!(resampler.is_consistent());
        let mut front_end = FrontEnd::<_, PHASES, TAPS>::new(self.cascade, &resampler);
        counts
            .iter()
            .filter_map(|&count| front_end.filter_sample(&Sample { counts: [count; CHANNELS] }))
            .map(|(electrodes, _)| f64::from(electrodes[0]) / f64::from(1 << GUARD_BITS))
            .collect()
    }
}

/// Outputs of scipy's filters, printed by `scipy_rates.py` next to the CSV file.
const GOLDEN: &str = include_str!("front_end/scipy_rates.csv");

/// Indices of the outputs that a line of the golden file covers.
const PICKED: std::ops::Range<usize> = 384..512;
/// A line of the golden file holds only every eighth of the outputs in [`PICKED`].
const EVERY: usize = 8;

/// Returns 20 mV of offset plus noise of at most 46 uV, as in `scipy_rates.py`.
fn counts(length: u32) -> Vec<i32> {
    let mut state = 1_u32;
    let next = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        894_784 + (state >> 20).cast_signed() - 2_048
    };
    (0..length).map(next).collect()
}

#[test]
fn the_outputs_equal_scipy_s_at_every_rate_and_decimation() {
    let mut lines = 0;
    for line in GOLDEN.lines().filter(|line| !line.starts_with('#')) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |field: &str| field.parse::<u32>().expect("a number");
        let (rate_hz, mains_hz) = (number(fields[0]), number(fields[1]));
        let decimation = match fields[2] {
            "literal" => Decimation::Literal,
            _ => Decimation::Fir,
        };
        let outputs = AtRate::new(rate_hz, mains_hz, decimation).steps(&counts(4 * rate_hz));
        assert_eq!(outputs.len(), PICKED.end);
        let expected = fields[3..].iter().map(|field| field.parse().expect("a number"));
        let picked = outputs[PICKED].iter().step_by(EVERY);
        let error_counts = picked
            .zip(expected)
            .map(|(found, expected): (&f64, f64)| (found - expected).abs())
            .fold(0.0, f64::max);
        let error_uv = error_counts * f64::from(LSB_NV) / 1_000.0;
        println!("{rate_hz:4} Hz, mains {mains_hz} Hz, {decimation:?}: {error_uv:.4} uV");
        // Two errors remain: the rounding of the signal, and the quantised coefficients, which at
        // 1000 Hz change the remaining offset by 2e-6 of 20 mV. Largest measured error: 0.040 uV.
        assert!(error_uv < 0.08, "{line}");
        lines += 1;
    }
    assert_eq!(lines, 2 * (6 + 3));
}

/// Amplitude of a tone in counts: 50 mV, far below the rail and far above the rounding.
const AMPLITUDE: f64 = 2_236_962.0;
/// Length of a tone, s; the filters settle well before its second half.
const TONE_S: u32 = 32;

/// Returns the gain of the filters and the decimation for a tone at `hz`, measured at the frequency
/// of the tone's alias in the steps.
fn alias(front_end: &AtRate, hz: u32) -> f64 {
    let rate = f64::from(front_end.rate_hz);
    #[expect(clippy::cast_possible_truncation, reason = "2.2 million counts")]
    let tone = |n: u32| {
        (AMPLITUDE * (2.0 * PI * f64::from(hz) * f64::from(n) / rate).sin()).round() as i32
    };
    let counts: Vec<i32> = (0..TONE_S * front_end.rate_hz).map(tone).collect();
    let steps = front_end.steps(&counts);
    let tail = &steps[steps.len() / 2..];
    let image = (hz % STEP_RATE_HZ).min(STEP_RATE_HZ - hz % STEP_RATE_HZ);
    let radians = 2.0 * PI * f64::from(image) / f64::from(STEP_RATE_HZ);
    let (mut re, mut im, mut length) = (0.0, 0.0, 0.0);
    for y in tail {
        re += y * f64::cos(radians * length);
        im += y * f64::sin(radians * length);
        length += 1.0;
    }
    2.0 * f64::hypot(re, im) / length / AMPLITUDE
}

#[test]
fn aliases_have_the_designed_attenuation() {
    let table = [Decimation::Literal, Decimation::Fir].map(|decimation| {
        let front_end = AtRate::new(512, 50, decimation);
        [68, 78, 100, 150].map(|hz| {
            let expected = front_end.chain().frequency_response(f64::from(hz)).norm();
            let found = alias(&front_end, hz);
            let [found_db, expected_db] = [found, expected].map(|gain| 20.0 * gain.log10());
            println!("{decimation:?}: {hz} Hz at {found_db:.1} dB, designed {expected_db:.1} dB");
            // Rounding the tone to counts adds noise 150 dB below the tone; 1e-7 is -140 dB.
            assert!((found - expected).abs() < 1e-3 * expected + 1e-7);
            found_db
        })
    });
    let [literal, fir] = table;
    // Gains in dB: for the paper's literal decimation, the expected values; for decimation with an
    // anti-aliasing filter, upper limits.
    for (found, stated) in literal.into_iter().zip([-7.1, -13.2, -26.4, -53.6]) {
        assert!((found - stated).abs() < 0.1, "{found} instead of {stated}");
    }
    for (found, limit) in fir.into_iter().zip([-23.0, -68.0, -110.0, -110.0]) {
        assert!(found < limit, "{found} instead of {limit}");
    }
}

/// Length of the 10 Hz burst, s.
const BURST_S: f64 = 8.0;
/// Length of the input with the burst, s.
const INPUT_S: u32 = 12;

/// Returns the value at `time_s` of a 10 Hz burst as sine and as cosine. Its Hann envelope starts
/// at 1 s; the peak is 1.
fn burst(time_s: f64) -> [f64; 2] {
    let part = (time_s - 1.0) / BURST_S;
    if !(0.0..1.0).contains(&part) {
        return [0.0; 2];
    }
    let envelope = (PI * part).sin().powi(2);
    let (sine, cosine) = (2.0 * PI * 10.0 * time_s).sin_cos();
    [envelope * sine, envelope * cosine]
}

/// Returns the envelope, at a delay of `delay_s`, of the cross-correlation of the steps with the
/// burst. The group delay moves this envelope; the phase delay moves the wave inside it.
fn correlation(steps: &[f64], delay_s: f64) -> f64 {
    let mut time_s = -delay_s;
    let mut sums = [0.0; 2];
    for y in steps {
        for (sum, wave) in sums.iter_mut().zip(burst(time_s)) {
            *sum += y * wave;
        }
        time_s += 1.0 / f64::from(STEP_RATE_HZ);
    }
    f64::hypot(sums[0], sums[1])
}

/// Returns the delay of the correlation's peak in seconds, found by ternary search.
fn peak(steps: &[f64]) -> f64 {
    let (mut low, mut high) = (0.0, 0.25);
    while high - low > 1e-7 {
        let third = (high - low) / 3.0;
        if correlation(steps, low + third) < correlation(steps, high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    f64::midpoint(low, high)
}

#[test]
fn a_burst_is_delayed_by_the_stated_group_delay_at_every_rate() {
    for (rate_hz, decimation) in [
        (250, Decimation::Fir),
        (256, Decimation::Literal),
        (256, Decimation::Fir),
        (500, Decimation::Fir),
        (512, Decimation::Literal),
        (512, Decimation::Fir),
        (1000, Decimation::Fir),
        (1024, Decimation::Literal),
        (1024, Decimation::Fir),
    ] {
        for mains_hz in [50, 60] {
            let front_end = AtRate::new(rate_hz, mains_hz, decimation);
            // The burst has a peak of 10 mV; one count is 113 dB below this peak.
            #[expect(clippy::cast_possible_truncation, reason = "447,392 counts")]
            let count =
                |n: u32| (447_392.0 * burst(f64::from(n) / f64::from(rate_hz))[0]).round() as i32;
            let counts: Vec<i32> = (0..INPUT_S * rate_hz).map(count).collect();
            let found_us = peak(&front_end.steps(&counts)) * 1e6;
            let stated_us = front_end.chain().group_delay_s(10.0) * 1e6;
            println!(
                "{rate_hz} Hz, mains {mains_hz} Hz, {decimation:?}: {found_us:.0} us, stated \
                 {stated_us:.0} us"
            );
            // Largest measured difference between the found and the stated delay: 1 us.
            assert!((found_us - stated_us).abs() < 5.0);
        }
    }
}

#[test]
fn the_model_states_the_delay_of_its_own_front_end() {
    let decimation = if model::TAPS == 1 { Decimation::Literal } else { Decimation::Fir };
    for mains in [&model::MAINS_50, &model::MAINS_60] {
        let rate_hz = model::ADC_RATE_HZ.into();
        let front_end = AtRate::new(rate_hz, mains.mains_hz.into(), decimation);
        let stated_us = f64::from(mains.group_delay_us);
        assert!((front_end.chain().group_delay_s(10.0) * 1e6 - stated_us).abs() < 1.0);
    }
}

#[test]
fn the_front_end_of_any_description_has_the_same_bits() {
    let mut description =
        Artifact::from_files(model::artifact_files::FILES).expect("the built-in model").description;
    description.adc.rate_hz = 500;
    description.filters.decimation = Decimation::Fir;
    let mut filters = Filters::new(&description, 50).expect("usual filters");
    let mut resampler = AnyResampler::new(&description).expect("a usual rate");
    let device = AtRate::new(500, 50, Decimation::Fir);
    let table = Resampler {
        down: device.table.down,
        taps: std::array::from_fn::<_, 32, _>(|phase| {
            std::array::from_fn::<_, 64, _>(|age| device.table.taps[phase][age])
        }),
    };
    let mut device = FrontEnd::new(device.cascade, &table);
    let mut outputs = 0;
    for n in 0..4_000_i32 {
        let counts = std::array::from_fn(|channel| {
            let channel = i32::try_from(channel).expect("64 channels");
            (n.wrapping_mul(n).wrapping_mul(31_337) + channel * 977) % 4_000_003
        });
        let expected = device.filter_sample(&Sample { counts });
        let expected = expected.map(|(step, _)| step.to_vec());
        let filtered = filters.filter_sample(&counts[..model::ELECTRODES]);
        assert_eq!(resampler.resample(filtered), expected, "sample {n}");
        outputs += usize::from(expected.is_some());
    }
    assert_eq!(outputs, 4_000 * 128 / 500);
}
