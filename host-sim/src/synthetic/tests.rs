//! Tests of the properties of the generated samples.

mod space;

use super::*;

/// The electrodes of the scalp grid, then Fpz at the front and O1 and O2 at the back of the head.
const LABELS: &str = "F3 F1 Fz F2 F4 FFC5 FFC3 FFC1 FFC2 FFC4 FFC6 FC5 FC3 FC1 FCz FC2 FC4 FC6 \
    FTT7 FCC5 FCC3 FCC1 FCC2 FCC4 FCC6 FTT8 C5 C3 C1 Cz C2 C4 C6 TTP7 CCP5 CCP3 CCP1 CCP2 CCP4 CCP6 \
    TTP8 CP5 CP3 CP1 CPz CP2 CP4 CP6 CPP5 CPP3 CPP1 CPP2 CPP4 CPP6 P3 P1 Pz P2 P4 PPO1 PPO2 \
    Fpz O1 O2";

fn spec() -> SyntheticSpec {
    SyntheticSpec::new(7, LABELS.split_whitespace())
}

fn quiet() -> SyntheticSpec {
    let (alpha_uv, mains_uv, offset_mv, drift_uv) = (0.0, 0.0, 0.0, 0.0);
    SyntheticSpec { alpha_uv, mains_uv, offset_mv, drift_uv, blinks: false, ..spec() }
}

fn channel(label: &str) -> usize {
    LABELS.split_whitespace().position(|other| other == label).expect("in the list")
}

/// Generates samples for `seconds` s and returns one vector per channel, uV.
fn generate(spec: &SyntheticSpec, seconds: usize) -> Vec<Vec<f64>> {
    let generator = Generator::new(spec).expect("a usable spec");
    let mut traces = vec![Vec::new(); CHANNELS];
    for sample in generator.take(512 * seconds) {
        for (trace, count) in traces.iter_mut().zip(sample) {
            trace.push(f64::from(count) * spec.lsb_uv);
        }
    }
    traces
}

/// Returns the peak amplitude at `hz`, uV, from the mean power in Hann windows of four seconds.
fn amplitude(trace: &[f64], hz: f64) -> f64 {
    let window = 4 * 512;
    let powers: Vec<f64> = trace
        .chunks_exact(window)
        .map(|part| {
            let (mut re, mut im) = (0.0, 0.0);
            let mean = part.iter().sum::<f64>() / 2048.0;
            for (k, x) in (0_u32..).zip(part) {
                let time = f64::from(k) / 512.0;
                let hann = 1.0 - (std::f64::consts::TAU * time / 4.0).cos();
                let (sin, cos) = (std::f64::consts::TAU * hz * time).sin_cos();
                re += (x - mean) * hann * cos;
                im += (x - mean) * hann * sin;
            }
            (re * re + im * im) * (2.0 / 2048.0_f64).powi(2)
        })
        .collect();
    mean(&powers).sqrt()
}

#[expect(clippy::cast_precision_loss, reason = "short slices")]
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let product = |x: &[f64], mean_x: f64, y: &[f64], mean_y: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y)).sum()
    };
    product(a, mean_a, b, mean_b)
        / (product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b)).sqrt()
}

#[test]
fn equal_seeds_yield_equal_bytes() {
    // Hash the little-endian counts of the first second with FNV-1a (64 bits).
    let hash = |spec: &SyntheticSpec| {
        let samples = Generator::new(spec).expect("a usable spec").take(512).flatten();
        samples.flat_map(i32::to_le_bytes).fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    };
    // Printed by this test on x86-64 Linux; every platform must yield the same value.
    assert_eq!(format!("{:016x}", hash(&spec())), "c6786010a8eea8d6");
    assert_ne!(hash(&spec()), hash(&SyntheticSpec { seed: 8, ..spec() }));
}

#[test]
fn the_background_falls_with_its_exponent() {
    let traces = generate(&quiet(), 240);
    let power = |hz: f64| {
        let near = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|d| amplitude(&traces[channel("Cz")], hz + d));
        near.iter().map(|a| a * a).sum::<f64>().log2()
    };
    // Each range spans two octaves. The exponent is 1.7 by design; the mean over 60 windows and 5
    // spectral lines has an uncertainty of about 0.1.
    for (low, high) in [(3.0, 12.0), (10.0, 40.0)] {
        let exponent = (power(low) - power(high)) / 2.0;
        assert!((1.4..2.0).contains(&exponent), "1/f^{exponent} from {low} to {high} Hz");
    }
}

#[test]
fn alpha_is_posterior_and_comes_in_bursts() {
    let only_alpha = SyntheticSpec { background_uv: 0.0, alpha_uv: 20.0, ..quiet() };
    let traces = generate(&only_alpha, 120);
    let at = |label| amplitude(&traces[channel(label)], 10.0);
    assert!(at("O1") > 3.0 * at("F3"), "O1 {} uV, F3 {} uV", at("O1"), at("F3"));
    assert!(at("PPO1") > 3.0 * at("Fz"), "PPO1 {} uV, Fz {} uV", at("PPO1"), at("Fz"));
    // A resonance at 10 Hz of half width 0.5 Hz falls to 0.5 / 10 at 20 Hz. Measured: 0.050.
    assert!(amplitude(&traces[channel("Pz")], 20.0) < 0.07 * at("Pz"));
    let halves = traces[channel("PPO1")].chunks_exact(256);
    let mut rms: Vec<f64> =
        halves.map(|part| mean(&part.iter().map(|x| x * x).collect::<Vec<_>>()).sqrt()).collect();
    rms.sort_by(f64::total_cmp);
    let (low, high) = (rms[rms.len() / 10], rms[rms.len() * 9 / 10]);
    assert!(high > 4.0 * low, "within half a second {low} to {high} uV RMS");
    assert!((8.0..40.0).contains(&high), "{high} uV RMS in a burst of 20");
}

#[test]
fn mains_has_its_frequency_and_amplitude() {
    for mains_hz in [50, 60] {
        let traces =
            generate(&SyntheticSpec { mains_hz, mains_uv: 20.0, background_uv: 0.0, ..quiet() }, 4);
        let hz = f64::from(mains_hz);
        let found: Vec<f64> = traces.iter().map(|trace| amplitude(trace, hz)).collect();
        assert!(found.iter().all(|uv| (9.9..30.1).contains(uv)), "{found:?}");
        // The amplitudes are uniform within 10 to 30 uV, so their SD is 5.8 uV. Three standard
        // errors of the mean of 64 amplitudes are 3 * 5.8 / 8 = 2.2 uV.
        assert!((mean(&found) - 20.0).abs() < 2.2, "{}", mean(&found));
        let widest =
            found.iter().copied().fold(0.0, f64::max) / found.iter().copied().fold(99.0, f64::min);
        assert!(widest > 1.5, "electrodes differ: {widest}");
        assert!(amplitude(&traces[0], 110.0 - hz) < 0.02, "nothing at the other mains");
    }
}

#[test]
fn offsets_are_millivolts_and_drift_is_slow() {
    let traces = generate(
        &SyntheticSpec { background_uv: 0.0, offset_mv: 20.0, drift_uv: 100.0, ..quiet() },
        20,
    );
    let means: Vec<f64> = traces.iter().map(|trace| mean(trace)).collect();
    assert!(means.iter().all(|uv| uv.abs() < 20_500.0));
    assert!(means.iter().filter(|uv| uv.abs() > 1000.0).count() > 50);
    for trace in &traces {
        let most = trace.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
        assert!(most < 1.0, "a step of {most} uV");
        // Sum the power of the spectral lines from 1 to 60 Hz. A Hann window has a noise bandwidth
        // of 1.5 lines. Measured: 0.2 uV RMS.
        let power = (4..=240).map(|line| amplitude(trace, f64::from(line) / 4.0).powi(2) / 2.0);
        let in_band = (power.sum::<f64>() / 1.5).sqrt();
        assert!(in_band < 1.0, "{in_band} uV RMS within 1-60 Hz");
    }
}

#[test]
fn blinks_are_frontal_and_every_few_seconds() {
    let traces = generate(&SyntheticSpec { background_uv: 0.0, blinks: true, ..quiet() }, 120);
    let front = &traces[channel("Fpz")];
    let blinks = front.windows(2).filter(|w| w[0] < 75.0 && w[1] >= 75.0).count();
    assert!((15..=60).contains(&blinks), "{blinks} blinks in two minutes");
    let highest = front.iter().copied().fold(0.0, f64::max);
    assert!((150.0..=300.1).contains(&highest), "{highest} uV");
    let at_cz = traces[channel("Cz")].iter().copied().fold(0.0, f64::max);
    assert!(at_cz < 0.3 * highest, "{at_cz} uV at Cz");
}

#[test]
fn the_rail_is_reached_only_on_request() {
    let railed = |spec: &SyntheticSpec| {
        let mut generator = Generator::new(spec).expect("a usable spec");
        let mut rail = [0_u64; CHANNELS];
        for _ in 0..512 * 60 {
            for (count, value) in rail.iter_mut().zip(generator.next_sample()) {
                *count += u64::from(matches!(value, 8_388_607 | -8_388_608));
            }
        }
        rail.iter().copied().filter(|&count| count > 0).collect::<Vec<_>>()
    };
    assert_eq!(railed(&spec()), [0_u64; 0]);
    let counts = railed(&SyntheticSpec { rails: true, ..spec() });
    assert!((2..=12).contains(&counts.len()), "{counts:?}");
    assert!(counts.iter().all(|&count| count >= 102), "at least 0.2 s each: {counts:?}");
}

#[test]
fn invalid_specs_are_refused() {
    let electrodes = |electrodes| SyntheticSpec { electrodes, ..spec() };
    let (name, value) = ("alpha_uv", -1.0);
    let mut cases = vec![
        (electrodes(vec!["Q7".to_owned()]), SyntheticError::UnknownElectrode("Q7".to_owned())),
        (electrodes(vec!["Cz".to_owned(); 65]), SyntheticError::TooManyElectrodes(65)),
        (SyntheticSpec { alpha_uv: value, ..spec() }, SyntheticError::Amplitude { name, value }),
        (SyntheticSpec { lsb_uv: 0.0, ..spec() }, SyntheticError::Scale(0.0)),
    ];
    for (rate_hz, mains_hz) in [(0, 50), (100, 50), (20_000, 50), (512, 0), (512, 256)] {
        let spec = SyntheticSpec { rate_hz, mains_hz, ..spec() };
        cases.push((spec, SyntheticError::Rate { rate_hz, mains_hz }));
    }
    for (spec, error) in cases {
        assert_eq!(Generator::new(&spec).err(), Some(error));
    }
}

#[test]
fn counts_follow_the_gain_of_the_adc_and_microvolts_do_not() {
    // Four times the microvolts per count, as at a gain of 6 instead of 24.
    let quarter = SyntheticSpec { lsb_uv: 4.0 * spec().lsb_uv, ..spec() };
    let [usual, coarse] = [&spec(), &quarter].map(|spec| generate(spec, 1));
    let mut largest = 0.0_f64;
    for (usual, coarse) in usual.iter().flatten().zip(coarse.iter().flatten()) {
        // The rounding error of each value is at most half of its own `lsb_uv`.
        let rounding = 0.5 * spec().lsb_uv + 0.5 * quarter.lsb_uv + 1e-9;
        assert!((usual - coarse).abs() <= rounding, "{usual} and {coarse} uV");
        largest = largest.max(usual.abs());
    }
    assert!(largest > 10.0, "{largest} uV");
}
