//! Tests of a cascade followed by a resampler: stop band, settling time and worst-case output. The
//! tests of `pipeline` measure aliases and delay.

use artifact::Decimation;
use fixed_dsp::Section;
use model_gen::{Chain, FilterSpec, ResamplerTable, cascade, response};

fn sections(rate_hz: u32, mains_hz: f64) -> Vec<Section> {
    cascade(&FilterSpec {
        rate_hz: rate_hz.into(),
        mains_hz,
        notch_q: 30.0,
        harmonics: 0,
        band_hz: [0.5, 60.0],
        order: 5,
    })
    .expect("the specification is realisable")
}

fn resampler(decimation: Decimation, rate_hz: u32) -> ResamplerTable {
    ResamplerTable::new(decimation, rate_hz, 128, 61).expect("a usual rate")
}

fn chain<'a>(sections: &'a [Section], resampler: &'a ResamplerTable, rate_hz: u32) -> Chain<'a> {
    Chain { sections, resampler, rate_hz }
}

#[test]
fn at_every_rate_the_low_pass_keeps_the_band_and_stops_its_aliases() {
    for rate in [250, 256, 500, 512, 1_000, 1_024] {
        let table = resampler(Decimation::Fir, rate);
        let gain = |hz: f64| 20.0 * table.frequency_response(hz, rate.into()).norm().log10();
        let shown = [50.0, 55.0, 60.0, 66.0, 68.0, 72.0, 78.0, 90.0, 100.0, 150.0].map(gain);
        eprintln!("{rate:>4} Hz {shown:>6.1?}");
        for tenth in 0..=500 {
            let hz = f64::from(tenth) / 10.0;
            assert!(gain(hz).abs() < 0.1, "{rate} Hz: {} dB at {hz} Hz", gain(hz));
        }
        // The stop band starts at 78 Hz, which aliases onto 50 Hz. The low-pass runs at `phases`
        // times the rate, and its response repeats from half of that rate on.
        let phases = u32::try_from(table.phases()).expect("at most 64 phases");
        let highest_hz = f64::from(rate * phases / 2);
        let stopped = (390..10_000).map(|fifth| f64::from(fifth) / 5.0);
        for hz in stopped.take_while(|hz| *hz < highest_hz) {
            // The largest gain measured at any rate is -54.7 dB, at 256 Hz.
            assert!(gain(hz) < -54.0, "{rate} Hz: {} dB at {hz} Hz", gain(hz));
        }
    }
}

#[test]
fn after_the_settling_time_every_output_stays_below_the_threshold() {
    for (decimation, rate) in [(Decimation::Literal, 512), (Decimation::Fir, 500)] {
        let (sections, resampler) = (sections(rate, 60.0), resampler(decimation, rate));
        let chain = chain(&sections, &resampler, rate);
        let settled = chain.settling_samples(1e-4).expect("the response decays");
        let outputs = resampled(&chain, &vec![1.0; 20_000]);
        let last =
            outputs.iter().rfind(|(_, y)| y.abs() >= 1e-4).expect("the step reaches the output");
        // The last output above the threshold may precede the stated time by up to 40 samples:
        // outputs are about four samples apart, and where the step starts decides which phase
        // settles last.
        assert!((settled - 40..settled).contains(&last.0), "{rate} Hz: {last:?}, {settled}");
    }
}

#[test]
fn the_worst_input_reaches_the_proven_gain_and_no_more() {
    let sections = sections(512, 50.0);
    for (decimation, expected) in [(Decimation::Literal, 3.784), (Decimation::Fir, 3.904)] {
        let resampler = resampler(decimation, 512);
        let chain = chain(&sections, &resampler, 512);
        let proven = chain.worst_gain().expect("the response decays");
        let mut impulse = vec![0.0; 20_000];
        impulse[0] = 1.0;
        let every_sample =
            Chain { resampler: &ResamplerTable { down: 1, ..resampler.clone() }, ..chain };
        let worst: Vec<f64> =
            resampled(&every_sample, &impulse).iter().rev().map(|(_, h)| h.signum()).collect();
        let reached = resampled(&every_sample, &worst)
            .iter()
            .fold(0.0, |largest: f64, (_, y)| largest.max(y.abs()));
        eprintln!("{decimation:?}: {reached} of {proven}");
        assert!((reached / proven - 1.0).abs() < 1e-6, "{reached} of {proven}");
        assert!((proven - expected).abs() < 5e-4, "{proven}");
    }
}

/// Returns the outputs of the chain, computed in f64 directly from the definition: for each output,
/// the index of the newest sample that it contains, and its value.
fn resampled(chain: &Chain, input: &[f64]) -> Vec<(usize, f64)> {
    let filtered: Vec<f64> = response::filter(chain.sections, input.iter().copied()).collect();
    let (down, phases) = (usize::from(chain.resampler.down), chain.resampler.phases());
    let rows: Vec<Vec<f64>> = chain.resampler.phase_responses().collect();
    (0..filtered.len() * phases)
        .step_by(down)
        .map(|time| (time / phases, time % phases))
        .map(|(sample, phase)| {
            let y = rows[phase]
                .iter()
                .zip(filtered[..=sample].iter().rev())
                .map(|(tap, x)| tap * x)
                .sum();
            (sample, y)
        })
        .collect()
}
