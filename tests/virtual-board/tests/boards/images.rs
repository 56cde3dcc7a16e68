//! Images under test, whose paths are in environment variables, and figures measured on them.

use std::env;
use std::fmt::{self, Display};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

use virtual_board::{Cable, Converters, Image, Model, Setup};

/// An image under test: its board, the cable that it supports, and its name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Subject {
    pub(crate) model: Model,
    pub(crate) cable: Cable,
    /// Name of the image in the recorded measurements and in names of environment variables.
    pub(crate) key: &'static str,
    /// Whether the image has another model than the built-in one.
    has_own_model: bool,
}

impl Subject {
    pub(crate) const fn new(model: Model, cable: Cable, key: &'static str) -> Self {
        Self { model, cable, key, has_own_model: false }
    }

    /// Marks the image as built with another model than the built-in one, and returns it.
    pub(crate) const fn with_own_model(self) -> Self {
        Self { has_own_model: true, ..self }
    }

    /// Returns the settings of a healthy board with the cable that the image supports.
    pub(crate) fn setup(self) -> Setup {
        Setup { converters: self.converters(), cable: self.cable, ..Setup::default() }
    }

    /// Returns the converters that the image's model is for.
    pub(crate) fn converters(self) -> Converters {
        let folder = self.model_folder();
        let converters = folder.map(|folder| Converters::of_model(&folder));
        converters.map_or(Converters::EIGHT, |converters| {
            converters.unwrap_or_else(|error| panic!("{error}"))
        })
    }

    /// Returns the folder of the image's model, from a variable such as `CORTICODE_MODEL_KIT_250`;
    /// `None` for the built-in model.
    ///
    /// # Panics
    /// When the variable is not set for an image with another model.
    pub(crate) fn model_folder(self) -> Option<PathBuf> {
        self.has_own_model.then(|| {
            let variable = self.variable("MODEL");
            let folder = env::var_os(&variable);
            PathBuf::from(folder.unwrap_or_else(|| panic!("{variable} is not set")))
        })
    }

    fn variable(self, what: &str) -> String {
        let word = self.key.to_uppercase().replace('-', "_");
        format!("CORTICODE_{what}_{word}")
    }

    /// Reads the image whose path is in a variable such as `CORTICODE_IMAGE_H743_UART`.
    ///
    /// # Panics
    /// When the variable is not set, or the image is missing, outdated or for another chip.
    pub(crate) fn image(self) -> Image {
        let variable = self.variable("IMAGE");
        let path = env::var_os(&variable).unwrap_or_else(|| {
            panic!(
                "{variable} is not set; `cargo xtask board {}` builds the images and runs these tests",
                self.key
            )
        });
        Image::read(Path::new(&path), self.model).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Prints the figure `key` with its `value`, a number or boolean, and appends it as a line of
    /// JSON to the file that `CORTICODE_FIGURES` names.
    pub(crate) fn record(self, key: &str, value: impl Display) {
        println!("{self}: {key} {value}");
        let Some(path) = env::var_os("CORTICODE_FIGURES") else {
            return;
        };
        let file = OpenOptions::new().append(true).create(true).open(path);
        // Write the line with a single call, so that lines of concurrent tests do not mix.
        let line = format!("{{\"board\":\"{self}\",\"{key}\":{value}}}\n");
        let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
        written.expect("CORTICODE_FIGURES names a writable file");
    }
}

impl fmt::Display for Subject {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.key)
    }
}
