//! With models other than the checked-in one, too, the pipeline streams the codes and packed blocks
//! of the batch references. Each model is built from an artifact, as a user builds it.
//!
//! `encoder_numpy.rs` compares the reference itself with numpy for networks of every mode, padding
//! and pool.

use std::thread;

use acceptance::other_model::OtherModel;
use any_model::{Size, any_artifact_with, any_packed};
use artifact::{
    CodeFormat,
    Mode::{self, Paper, PaperCodeOnly, Pca, Shortcut},
    NetworkShape, Padding,
};

/// Models to build (mode, padding, pool, size). Together they use every kernel, both ends of a
/// padded window, for each optional part an encoder without it, every overlap of windows, and the
/// ends of every parameter's range.
const VARIANTS: [(Mode, Padding, [usize; 3], Size); 7] = [
    (Paper, Padding::None, [2, 2, 2], Size::paper(16)),
    (Paper, Padding::None, [4, 3, 3], Size::paper(8)),
    (Shortcut, Padding::All, [2, 2, 2], Size::paper(4)),
    (Shortcut, Padding::All, [1, 3, 1], Size::paper(16)),
    (Pca, Padding::None, [2, 2, 2], SMALLEST),
    (Shortcut, Padding::None, [2, 2, 2], LARGEST),
    (PaperCodeOnly, Padding::Space, [1, 1, 2], ROW),
];

/// Size of the smallest model. Its grid of four electrodes is too small for a convolution.
const SMALLEST: Size = Size {
    grid: [2, 2],
    electrodes: 4,
    steps: 16,
    hop: 4,
    numbers: 8,
};

/// Size of the largest model.
const LARGEST: Size = Size {
    grid: [12, 12],
    electrodes: 64,
    steps: 32,
    hop: 4,
    numbers: 256,
};

/// Size of a model with one row of electrodes, which a convolution can read only with padding.
const ROW: Size = Size {
    grid: [1, 8],
    electrodes: 8,
    steps: 32,
    hop: 8,
    numbers: 32,
};

/// Formats of the codes; successive variants use them in turn.
const FORMATS: [CodeFormat; 3] = [
    CodeFormat::Int8Exponent,
    CodeFormat::Int16,
    CodeFormat::Int8,
];

/// Arguments of cargo that build, for a model, the test of the network's codes.
const BUILD: &str = "build --workspace --test=streaming_equals_batch";
/// Argument in addition to [`BUILD`] that also builds the test of the packed code.
const PACKED: &str = " --test=packed_equals_batch";

#[test]
fn streaming_equals_batch_with_every_variant() {
    let formats = FORMATS.into_iter().cycle();
    // Run the tests of a variant while cargo builds the next one.
    thread::scope(|scope| {
        for ((seed, (mode, padding, pool, size)), format) in (1..).zip(VARIANTS).zip(formats) {
            let folder = tempfile::tempdir().expect("a folder");
            let artifact = any_artifact_with(seed, |description| {
                description.mode = mode;
                description.network = NetworkShape { padding, pool };
                size.apply(description);
            });
            let mut artifact = artifact.expect("a model");
            artifact.description.code.format = format;
            // The packed code does not depend on the network, so one model of each size has it.
            let has_packed = size.electrodes != 61 || size.hop == 16;
            let packed = has_packed.then(|| any_packed(seed, &artifact.description));
            let artifact = artifact.with_packed(packed).expect("a packed model");
            artifact.write(folder.path()).expect("a folder to write to");
            let tests = BUILD.to_owned() + if has_packed { PACKED } else { "" };
            let built = OtherModel::build(folder.path(), &[&tests]);
            scope.spawn(move || {
                println!("{mode:?}, padding {padding:?}, pool {pool:?}, {size:?}, {format}");
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
