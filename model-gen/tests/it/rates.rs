//! Tests of models for other amplifiers: every usual rate, both kinds of decimation, and notches at
//! the mains frequency and up to two harmonics.

use std::{error::Error, path::Path};

use artifact::{Artifact, Decimation, Description};
use model_gen::{DeviceModel, MAINS_HZ, ModelGenError, manifest, rust_files};

fn model(change: impl Fn(&mut Description)) -> Result<DeviceModel, ModelGenError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../signal/model/artifact");
    let mut artifact = Artifact::read(&folder)?;
    change(&mut artifact.description);
    DeviceModel::new(&artifact)
}

#[test]
fn every_usual_rate_yields_a_model_with_all_ranges_proven() {
    for rate in [250, 256, 500, 512, 1_000, 1_024] {
        for decimation in [Decimation::Literal, Decimation::Fir] {
            for harmonics in 0..=2 {
                let fits = rate % 128 == 0 || decimation == Decimation::Fir;
                let below_nyquist = (harmonics + 1) * 60 < rate / 2;
                let made = model(|d| {
                    d.adc.rate_hz = rate;
                    d.filters.decimation = decimation;
                    d.filters.harmonics = harmonics;
                });
                let case = format!("{rate} Hz, {decimation:?}, {harmonics} harmonics");
                match made {
                    Ok(model) => {
                        assert!(fits && below_nyquist, "{case} should have been refused");
                        check_generated_texts(&model, &case);
                    }
                    Err(error) => assert!(!fits || !below_nyquist, "{case}: {error:?}"),
                }
            }
        }
    }
}

/// Asserts that the generated source and the manifest contain the model's numbers; `case`
/// identifies the model in messages.
fn check_generated_texts(model: &DeviceModel, case: &str) {
    let text = rust_files(model).map(|(_, text)| text).concat();
    let manifest = manifest(model);
    let (table, filters) = (&model.resampler, &model.description.filters);
    let sections = 6 + filters.harmonics;
    for expected in [
        format!("pub const SECTIONS: usize = {sections};"),
        format!("pub const PHASES: usize = {};", table.phases()),
        format!("pub const TAPS: usize = {};", table.taps_per_phase()),
        format!("    down: {},", table.down),
        "pub const WINDOW_CENTRE_US: u32 = 58_594;".to_owned(),
    ] {
        assert!(text.contains(&expected), "{case}: no `{expected}`");
    }
    for (filter, mains_hz) in model.filters.iter().zip(MAINS_HZ) {
        assert!(text.contains(&format!("pub static MAINS_{mains_hz}: MainsFilter")));
        let output = filter.gains.last().expect("a chain has nodes");
        assert_eq!(output.node, "output of the resampler");
        assert!(manifest.contains(&format!("{:.4}", output.gain)), "{case}");
        assert_eq!(filter.scalp_delay_us, filter.group_delay_us + 58_594);
        // At 50 Hz mains without harmonics, the delay of the cascade is 11 ms and the delay of the
        // low-pass 60 to 64 ms. The ranges also allow for 60 Hz mains and notches at harmonics.
        let expected_us = match filters.decimation {
            Decimation::Literal => 9_000..13_000,
            Decimation::Fir => 70_000..77_000,
        };
        assert!(expected_us.contains(&filter.group_delay_us), "{case}: {filter:?}");
        assert!(filter.description.contains(&format!("notch {mains_hz}")), "{case}");
        // The wire format limits the filters' description to 256 bytes.
        assert!(filter.description.len() < 256, "{case}");
    }
}

#[test]
fn the_cause_of_an_impossible_rate_states_number_reason_and_remedy() {
    let refused = |change: fn(&mut Description)| {
        let error = model(change).expect_err("this cannot be realised");
        let cause = error.source().map(ToString::to_string).unwrap_or_default();
        format!("{error}: {cause}")
    };
    for (change, expected) in [
        (
            (|d| d.adc.rate_hz = 500) as fn(&mut Description),
            "the decimation cannot be realised: literal decimation keeps every n-th sample, but 500 Hz is not a \
             multiple of 128 Hz: write [filters] decimation = \"fir\"",
        ),
        (
            |d| d.filters.notch_q = 1e11,
            "the filters for 50 Hz mains cannot be realised: section 0 is unstable after quantisation",
        ),
    ] {
        let message = refused(change);
        assert!(message.contains(expected), "`{message}` lacks `{expected}`");
    }
}
