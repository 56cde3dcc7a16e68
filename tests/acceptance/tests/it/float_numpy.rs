//! The float encoder and decoder compute what numpy computes from the same artifact, for networks
//! of every mode, padding and pool.

use std::fs;
use std::path::Path;

use acceptance::numpy_reference;
use artifact::{ArtifactError, FloatDecoder, FloatEncoder, Mode};

/// Number of windows that are compared for each variant of the network.
const WINDOWS: usize = 2;

/// Largest permitted difference, as a ratio to the largest magnitude. The Rust code sums at most
/// 10,368 products in f32, each with a relative rounding error of 6e-8. The largest ratio measured
/// is 1.5e-6.
const TOLERANCE: f64 = 1e-5;

#[test]
fn numpy_computes_the_float_codes_and_windows_of_every_variant() {
    if !numpy_reference::available("float network against numpy") {
        return;
    }
    let mut worst: f64 = 0.0;
    for (seed, (mode, padding, pool)) in (1..).zip(any_model::every_variant()) {
        let what = format!("{mode:?}, {padding:?}, {pool:?}");
        let artifact = any_model::any_artifact(seed, mode, padding, pool, 8).expect("an artifact");
        let windows = any_model::windows(seed, &artifact, WINDOWS);
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        artifact.write(folder).expect("the folder is writable");
        let numbers = windows.iter().flat_map(|window| window.iter());
        let bytes: Vec<u8> = numbers.flat_map(|x| x.to_le_bytes()).collect();
        fs::write(folder.join("windows.f32"), bytes).expect("the folder is writable");
        numpy_reference::run("float_numpy.py", folder).expect("numpy's network");

        let encoder = FloatEncoder::new(&artifact).expect("an encoder");
        let codes: Vec<_> = windows.iter().map(|w| encoder.encode(w)).collect();
        let dimensions = artifact.description.dimensions();
        let theirs = numbers_of(&folder.join("codes.f64"));
        worst = worst.max(difference(&codes.concat(), &theirs, &what));
        assert_eq!(theirs.len(), WINDOWS * dimensions.numbers, "{what}");
        if mode == Mode::Paper {
            let refusal = FloatDecoder::new(&artifact);
            assert!(matches!(refusal, Err(ArtifactError::NotDecodable)), "{what}");
            continue;
        }
        let decoder = FloatDecoder::new(&artifact).expect("a decoder");
        let decoded: Vec<f32> = codes.iter().flat_map(|z| decoder.decode(z)).collect();
        let theirs = numbers_of(&folder.join("windows.f64"));
        worst = worst.max(difference(&decoded, &theirs, &what));
        assert_eq!(theirs.len(), WINDOWS * dimensions.window_electrodes(), "{what}");
    }
    println!("largest difference {worst:.1e} of the largest magnitude");
}

/// Checks that the Rust results `ours` and numpy's `theirs` are equal within [`TOLERANCE`]. Returns
/// the ratio of the largest difference to the largest magnitude.
fn difference(ours: &[f32], theirs: &[f64], what: &str) -> f64 {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let pairs = ours.iter().zip(theirs);
    let error = pairs.map(|(a, b)| (f64::from(*a) - b).abs());
    let largest = theirs.iter().fold(0.0_f64, |m, b| m.max(b.abs()));
    assert!(largest > 0.1, "{what}: {largest}");
    let relative = error.fold(0.0, f64::max) / largest;
    assert!(relative < TOLERANCE, "{what}: {relative:e}");
    relative
}

fn numbers_of(path: &Path) -> Vec<f64> {
    let bytes = fs::read(path).expect("numpy's numbers");
    let (words, _) = bytes.as_chunks();
    words.iter().map(|word| f64::from_le_bytes(*word)).collect()
}
