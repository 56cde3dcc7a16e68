//! With models other than the checked-in one, the pipeline streams the same codes and packed blocks
//! as the batch references. Each model is built from an artifact, as a user builds it. Two of the
//! models are for montages in `files/montages/`; `montages.rs` has the others.
//!
//! `encoder_numpy.rs` compares the reference itself with numpy for networks of every mode, padding
//! and pool.

use std::thread;

use acceptance::other_model::OtherModel;
use any_model::{Size, any_artifact_with, any_packed, apply_montage};
use artifact::{
    CodeFormat, Description,
    Mode::{self, Paper, PaperCodeOnly, Pca, Shortcut},
    MontageFile, NetworkShape, Padding,
};

use Input::{Montage, Sized};

/// Models to build (mode, padding, pool, input). Together they cover every kernel, both ends of a
/// padded window, encoders that lack each of the optional parts, every overlap of windows, and both
/// ends of every parameter's range.
const VARIANTS: [(Mode, Padding, [usize; 3], Input); 7] = [
    (Paper, Padding::None, [2, 2, 2], Montage("ten-twenty-32")),
    (Paper, Padding::None, [4, 3, 3], Sized(Size::paper(8))),
    (Shortcut, Padding::All, [2, 2, 2], Sized(Size::paper(4))),
    (Shortcut, Padding::All, [1, 3, 1], Montage("cyton-16")),
    (Pca, Padding::None, [2, 2, 2], Sized(SMALLEST)),
    (Shortcut, Padding::None, [2, 2, 2], Sized(LARGEST)),
    (PaperCodeOnly, Padding::Space, [1, 1, 2], Sized(ROW)),
];

/// Electrodes and windows of a model.
#[derive(Debug)]
enum Input {
    /// A montage file, and windows that do not overlap.
    Montage(&'static str),
    /// A size that no montage has.
    Sized(Size),
}

impl Input {
    fn apply(&self, montages: &[MontageFile], description: &mut Description) {
        match self {
            Montage(name) => {
                let montage = montages.iter().find(|montage| montage.name == *name);
                apply_montage(montage.expect("the montage"), description);
                description.window.hop = description.window.steps;
            }
            Sized(size) => size.apply(description),
        }
    }
}

/// Size of the smallest model. Its grid of four electrodes is too small for a convolution.
const SMALLEST: Size = Size { grid: [2, 2], electrodes: 4, steps: 16, hop: 4, numbers: 8 };

/// Size of the largest model.
const LARGEST: Size = Size { grid: [12, 12], electrodes: 64, steps: 32, hop: 4, numbers: 256 };

/// Size of a model with one row of electrodes, which a convolution can read only with padding.
const ROW: Size = Size { grid: [1, 8], electrodes: 8, steps: 32, hop: 8, numbers: 32 };

/// Formats of the codes; successive variants use them in turn.
const FORMATS: [CodeFormat; 3] = [CodeFormat::Int8Exponent, CodeFormat::Int16, CodeFormat::Int8];

/// Arguments of cargo that build, for a model, the test of the network's codes.
const BUILD: &str = "build --workspace --test=streaming_equals_batch";
/// Argument in addition to [`BUILD`] that also builds the test of the packed code.
const PACKED: &str = " --test=packed_equals_batch";

#[test]
fn streaming_equals_batch_with_every_variant() {
    let formats = FORMATS.into_iter().cycle();
    let montages = any_model::montages().expect("the montages");
    // Run the tests of a variant while cargo builds the next one.
    thread::scope(|scope| {
        for ((seed, (mode, padding, pool, input)), format) in (1..).zip(VARIANTS).zip(formats) {
            let folder = tempfile::tempdir().expect("a folder");
            let artifact = any_artifact_with(seed, |description| {
                description.mode = mode;
                description.network = NetworkShape { padding, pool };
                input.apply(&montages, description);
            });
            let mut artifact = artifact.expect("a model");
            artifact.description.code.format = format;
            // For 61 electrodes, leave out the packed code: the tests of `pipeline` compare it.
            let has_packed = artifact.description.montage.electrodes.len() != 61;
            let packed = has_packed.then(|| any_packed(seed, &artifact.description));
            let artifact = artifact.with_packed(packed).expect("a packed model");
            artifact.write(folder.path()).expect("a folder to write to");
            let tests = BUILD.to_owned() + if has_packed { PACKED } else { "" };
            let built = OtherModel::build(folder.path(), &tests);
            scope.spawn(move || {
                println!("{mode:?}, padding {padding:?}, pool {pool:?}, {input:?}, {format}");
                // Keep the model's folder until the tests, which read it, have ended.
                let _folder = folder;
                built.test("streaming_equals_batch", "");
                if has_packed {
                    built.test("packed_equals_batch", "");
                }
            });
        }
    });
}
