//! Fuzz targets: each passes untrusted bytes to one reader, and panics if the reader violates a
//! property that the target checks, such as that a file which was read can be written again.
//!
//! `cargo fuzz` searches for inputs that make a target panic. The tests of this crate run a
//! bounded, repeatable search; see [`search`].
#![forbid(unsafe_code)]

mod files;
mod model;
mod mutation;
mod page;
#[path = "../../../files/recordings/tests/it/files.rs"]
#[expect(dead_code, reason = "the tests of `recordings` use more of it")]
mod recording_files;
mod ros;
mod upload;
mod wire;

use std::path::Path;
use std::{fs, thread};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A reader of bytes, with valid inputs to start from.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name of the target, as in `cargo fuzz run NAME`.
    pub name: &'static str,
    /// Returns valid inputs.
    seeds: fn() -> Vec<Vec<u8>>,
    /// Passes one input to the reader.
    ///
    /// # Panics
    /// When the reader violates a property that the target checks.
    read: fn(&[u8]) -> Outcome,
    /// Number of inputs that a [`search`] reads.
    pub inputs: u32,
}

/// What a reader did with an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The reader took the input, or a part of it, as valid.
    Accepted,
    /// The reader took nothing of the input as valid.
    Refused,
}

impl Outcome {
    fn accepted_if(accepted: bool) -> Self {
        if accepted { Self::Accepted } else { Self::Refused }
    }
}

/// All targets, in alphabetical order. The tests run each target on mutated inputs for a few
/// seconds.
#[rustfmt::skip]
pub const TARGETS: [Target; 13] = [
    Target { name: "artifact", seeds: model::seeds, read: model::artifact, inputs: 5_000 },
    Target { name: "bdf", seeds: files::bdf_seeds, read: files::recording, inputs: 1_500 },
    Target { name: "code_file", seeds: files::code_file_seeds, read: files::code_file, inputs: 300 },
    Target { name: "commands", seeds: wire::command_seeds, read: wire::commands, inputs: 500 },
    Target { name: "dfu", seeds: files::dfu_seeds, read: files::dfu, inputs: 5_000 },
    Target { name: "edf", seeds: files::edf_seeds, read: files::recording, inputs: 1_500 },
    Target { name: "frames", seeds: wire::frame_seeds, read: wire::frames, inputs: 400 },
    Target { name: "gdf", seeds: files::gdf_seeds, read: files::recording, inputs: 1_500 },
    Target { name: "tcpros", seeds: ros::tcpros_seeds, read: ros::tcpros, inputs: 50_000 },
    Target { name: "uploaded_model", seeds: upload::seeds, read: upload::uploaded_model, inputs: 150 },
    Target { name: "view_request", seeds: page::request_seeds, read: page::request, inputs: 50_000 },
    Target { name: "wire_recording", seeds: files::wire_recording_seeds, read: files::wire_recording, inputs: 10_000 },
    Target { name: "xmlrpc", seeds: ros::xmlrpc_seeds, read: ros::xmlrpc, inputs: 50_000 },
];

/// Returns the target called `name`.
///
/// # Panics
/// When no target has this name.
pub fn target(name: &str) -> Target {
    let found = TARGETS.iter().find(|target| target.name == name);
    *found.unwrap_or_else(|| panic!("no fuzz target is called {name:?}"))
}

impl Target {
    /// Passes one input to the target's reader.
    ///
    /// # Panics
    /// When the reader violates a property that the target checks.
    pub fn read(&self, bytes: &[u8]) -> Outcome {
        (self.read)(bytes)
    }

    /// Returns valid inputs to start from.
    pub fn seeds(&self) -> Vec<Vec<u8>> {
        (self.seeds)()
    }
}

/// Passes one input to the target called `name`; called by `cargo fuzz`.
///
/// # Panics
/// When the reader violates a property that the target checks, or no target has this name.
pub fn run(name: &str, bytes: &[u8]) {
    target(name).read(bytes);
}

/// Returns the inputs, stored in the folder `corpus`, for which the target's reader once violated a
/// checked property. They are in the order of their file names.
///
/// # Panics
/// When a stored input cannot be read.
pub fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let Ok(files) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut paths: Vec<_> = files.map(|file| file.expect("a file").path()).collect();
    paths.sort();
    let read = |path| fs::read(path).expect("a readable file");
    paths.iter().map(read).collect()
}

/// Number of inputs that a [`search`] read, by outcome.
#[derive(Clone, Copy, Debug, Default)]
pub struct Searched {
    /// Number of accepted inputs.
    pub accepted: u32,
    /// Number of refused inputs.
    pub refused: u32,
}

/// Passes [`Target::inputs`] mutations of the seeds and of the [`corpus`] to the target's reader.
/// Every search uses the same mutations.
///
/// # Panics
/// When the reader violates a property that the target checks; prints the input first.
pub fn search(target: &Target) -> Searched {
    let seeds = [target.seeds(), corpus(target.name)].concat();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut searched = Searched::default();
    for _ in 0..target.inputs {
        let input = mutation::mutate(&seeds, &mut random);
        let _shown = ShownOnPanic(&input);
        match target.read(&input) {
            Outcome::Accepted => searched.accepted += 1,
            Outcome::Refused => searched.refused += 1,
        }
    }
    searched
}

/// Prints an input when it is dropped because of a panic.
struct ShownOnPanic<'i>(&'i [u8]);

impl Drop for ShownOnPanic<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            eprintln!("the input is \"{}\"", self.0.escape_ascii());
        }
    }
}
