//! Fuzz target for the files of a trained model.

use std::fs;
use std::sync::LazyLock;

use any_model::{Size, any_artifact_with, any_packed};
use artifact::{Artifact, Mode, NetworkShape, Padding};

use crate::Outcome;

/// Size of a model with small files. The network reads its single row of electrodes with padding.
const SMALL: Size = Size { grid: [1, 8], electrodes: 8, steps: 32, hop: 8, numbers: 8 };

/// Returns the files of small models, each after its length in four bytes.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    static SEEDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
        [seed(Mode::Pca, false), seed(Mode::Pca, true), seed(Mode::Shortcut, true)].into()
    });
    SEEDS.clone()
}

fn seed(mode: Mode, packed: bool) -> Vec<u8> {
    let artifact = any_artifact_with(1, |description| {
        description.mode = mode;
        description.network = NetworkShape { padding: Padding::All, pool: [2, 1, 1] };
        SMALL.apply(description);
    });
    let artifact = artifact.expect("a model");
    let packed = packed.then(|| any_packed(1, &artifact.description));
    let artifact = artifact.with_packed(packed).expect("a packed model");
    let folder = tempfile::tempdir().expect("a folder");
    artifact.write(folder.path()).expect("written");
    let files = Artifact::FILES.map(|name| fs::read(folder.path().join(name)).unwrap_or_default());
    let part = |file: &Vec<u8>| {
        let length = u32::try_from(file.len()).expect("a small file");
        [&length.to_le_bytes()[..], file].concat()
    };
    files.iter().flat_map(part).collect()
}

/// Reads a model and quantises it to integers. An accepted model must have the same id when read
/// again.
pub(crate) fn artifact(mut bytes: &[u8]) -> Outcome {
    let files = Artifact::FILES.map(|name| (name, part(&mut bytes)));
    let files: Vec<_> = files.into_iter().filter(|(_, file)| !file.is_empty()).collect();
    let Ok(artifact) = Artifact::from_files(&files) else {
        return Outcome::Refused;
    };
    let again = Artifact::from_files(&files).expect("as before");
    assert_eq!(artifact.id, again.id);
    Outcome::accepted_if(model_gen::quantise(&artifact).is_ok())
}

/// Removes and returns the first part of the bytes, or all bytes if the part's length is too large.
fn part<'b>(bytes: &mut &'b [u8]) -> &'b [u8] {
    let Some((length, rest)) = bytes.split_first_chunk::<4>() else {
        return &[];
    };
    let length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(usize::MAX);
    let (part, rest) = rest.split_at(length.min(rest.len()));
    *bytes = rest;
    part
}
