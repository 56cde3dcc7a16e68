//! Tests weighted models of synthetic heads: the metric against numpy, errors, ranges and misfits.

use super::*;
use crate::evaluation::evaluate;
use crate::fit::fit;
use crate::personal_model::tests::description;
use artifact::{Artifact, Description, Mode, PackedModel};
use packed::{PROBE_SHIFT, PROBES};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::io::Write as _;
use std::process::Command;

const ELECTRODES: usize = 8;
/// Number of coefficients of a block, fewer than its 64 values.
const COEFFICIENTS: usize = 48;

fn motor() -> ErrorWeight {
    weight_for("motor").unwrap()
}

/// Returns the weights with which four sources reach the electrodes: three loud sources and, last,
/// the rhythm.
fn mixture(seed: u64) -> [[f32; ELECTRODES]; 4] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// Returns 90 s of a head with three loud, slow sources and a quiet rhythm of 8 to 30 Hz.
fn head(seed: u64) -> Track {
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
    let noise: Vec<f32> = (0..90 * 128).map(|_| rng.random_range(-30.0..30.0)).collect();
    let sections = model_gen::band_power_sections([8.0, 30.0], 128.0);
    let rhythm = band_passed(&Track::new("rhythm", 1, noise), &sections);
    let weights = mixture(seed);
    let mut slow = [0.0_f32; 3];
    let values = rhythm.iter().flat_map(|rhythm| {
        for source in &mut slow {
            *source = 0.95 * *source + rng.random_range(-20.0..20.0);
        }
        #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
        let sources = [slow[0], slow[1], slow[2], *rhythm as f32];
        let at = |electrode: usize| {
            let parts = sources.iter().zip(&weights);
            parts.map(|(source, weights)| source * weights[electrode]).sum::<f32>()
        };
        let values: [f32; ELECTRODES] = std::array::from_fn(at);
        values.map(|value| value + rng.random_range(-0.5..0.5))
    });
    Track::new("head", ELECTRODES, values.collect())
}

#[test]
fn the_root_is_numpys_and_its_square_times_the_inverse_is_the_identity() {
    let track = head(1).part(0..20 * 128);
    let metric = Metric::new(motor(), std::slice::from_ref(&track), 8, 128).unwrap();
    let (root, size) = (metric.root(), 8 * ELECTRODES);
    let identity = &root * &root * metric.inverse();
    assert!((identity - DMatrix::identity(size, size)).amax() < 1e-9);

    let file = std::env::temp_dir().join(format!("corticode-weight-{}", std::process::id()));
    let bytes = track.values.iter().flat_map(|uv| uv.to_le_bytes());
    std::fs::write(&file, bytes.collect::<Vec<u8>>()).unwrap();
    // Use Debian's Python: another Python on the PATH can lack numpy.
    let mut python = Command::new("/usr/bin/python3");
    python.args(["-c", include_str!("reference.py"), "8"]).arg(&file);
    let output = python.output();
    std::fs::remove_file(&file).unwrap();
    let errors = match &output {
        Ok(output) => String::from_utf8_lossy(&output.stderr).into_owned(),
        Err(error) => error.to_string(),
    };
    if output.is_err() || errors.contains("No module named 'numpy'") {
        let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
        assert!(!required, "python3-numpy is not installed");
        // The test harness would capture the output of a print macro.
        let line = b"SKIPPED: weighted error against numpy: no python3-numpy\n";
        std::io::stderr().write_all(line).unwrap();
        return;
    }
    let output = output.unwrap();
    assert!(output.status.success(), "{errors}");
    let text = String::from_utf8(output.stdout).unwrap();
    let expected = text.split_whitespace().map(|number| number.parse::<f64>().unwrap());
    let expected = DMatrix::from_row_iterator(size, size, expected);
    let difference = (&root - &expected).amax() / expected.amax();
    assert!(difference < 1e-6, "{difference}");
}

/// Returns the bits of a block at rates 0 to 5, and the ratio of the rhythm's power to the power of
/// its error, dB. The rhythm is extracted with the filter that suppresses the loud sources.
fn rhythm_snr(model: &PackedModel, track: &Track, description: &Description) -> Vec<[f64; 2]> {
    let weights = mixture(1).map(|weights| weights.map(f64::from));
    let mixture = DMatrix::from_fn(ELECTRODES, 4, |electrode, source| weights[source][electrode]);
    let filter = mixture.svd(true, true).pseudo_inverse(1e-9).unwrap();
    let sections = model_gen::band_power_sections([8.0, 30.0], 128.0);
    let power = |values: Vec<f32>| {
        let signals = band_passed(&Track::new("", ELECTRODES, values), &sections);
        (filter.row(3) * signals).norm_squared()
    };
    let sd_uv = description.input.sd_uv;
    let mut ratios = Vec::new();
    let mut observe = |decoded: &[DMatrix<f32>]| {
        #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
        let errors = decoded[0].iter().zip(&track.values).map(|(x, uv)| x * sd_uv as f32 - uv);
        ratios.push(10.0 * (power(track.values.clone()) / power(errors.collect())).log10());
    };
    let tracks = std::slice::from_ref(track);
    let figures = evaluate(model, tracks, description, &mut observe).unwrap();
    let pairs = figures.iter().zip(ratios).map(|(figures, ratio)| [figures.bits, ratio]);
    pairs.take(6).collect()
}

#[test]
fn a_quiet_rhythm_has_a_smaller_error_at_equal_bits() {
    let (track, description) = (head(1), description());
    let fitted = |weight| {
        let tracks = std::slice::from_ref(&track);
        fit(tracks, &description, COEFFICIENTS, weight, &mut |_| ()).unwrap()
    };
    let weighted = fitted(Some(motor()));
    // Creating an artifact fails if a sum of the model's integers could overflow.
    let mut alone = description.clone();
    (alone.mode, alone.code.numbers) = (Mode::Packed, 0);
    Artifact::without_network(alone, 640.0, weighted.clone()).unwrap();
    let plain = rhythm_snr(&fitted(None), &track, &description);
    let mut compared = 0;
    for [bits, ratio] in rhythm_snr(&weighted, &track, &description) {
        let pair = plain.windows(2).find(|pair| (pair[1][0]..=pair[0][0]).contains(&bits));
        let Some([[more, finer], [less, coarser]]) = pair else {
            continue;
        };
        let part = (bits / less).log2() / (more / less).log2();
        let expected = coarser + part * (finer - coarser);
        compared += 1;
        assert!(ratio > expected + 2.0, "{ratio} dB beside {expected} dB in {bits} bits");
    }
    assert!(compared >= 3, "{compared}");
}

#[test]
fn probes_find_another_head_and_a_noisy_electrode() {
    let description = description();
    let model = fit(&[head(1)], &description, COEFFICIENTS, Some(motor()), &mut |_| ()).unwrap();
    let misfits = |track: &Track| {
        let blocks = track.values.chunks_exact(8 * ELECTRODES);
        let count = blocks.len();
        let is_misfit = |block: &[f32]| {
            #[expect(clippy::cast_possible_truncation, reason = "within 2 mV")]
            let values: Vec<i16> = block.iter().map(|uv| (2.0 * uv).round() as i16).collect();
            let energy =
                |numbers: &[i16]| numbers.iter().map(|&n| f64::from(n).powi(2)).sum::<f64>();
            let probes = &model.analyse(&values)[COEFFICIENTS - PROBES..];
            let permitted = 4.0 * model.description.misfit_uv2 * values.len() as f64;
            f64::from(1 << PROBE_SHIFT) * energy(probes) > permitted + energy(&values) / 64.0
        };
        blocks.filter(|block| is_misfit(block)).count() as f64 / count as f64
    };
    let own = head(1);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut noisy = own.clone();
    for value in noisy.values.iter_mut().step_by(ELECTRODES) {
        *value += rng.random_range(-100.0..100.0);
    }
    let [own, other, noisy] = [&own, &head(2), &noisy].map(misfits);
    assert!(own < 0.01 && other > 0.5 && noisy > 0.5, "{own} {other} {noisy}");
}
