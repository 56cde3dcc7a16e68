//! Images under test, from paths in environment variables.

use std::env;
use std::fmt;
use std::path::Path;

use virtual_board::{Cable, Image, Model, Setup};

/// An image under test: its board, the cable it uses and its name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Subject {
    pub(crate) model: Model,
    pub(crate) cable: Cable,
    /// Name of the image in figures.
    pub(crate) key: &'static str,
}

impl Subject {
    /// Returns the configuration of a healthy board with the cable of the image.
    pub(crate) fn setup(self) -> Setup {
        Setup {
            cable: self.cable,
            ..Setup::default()
        }
    }

    /// Reads the image that `CORTICODE_IMAGE_H743`, `.._H743_UART`, `.._F446`, `.._F446_USB` or `.._F446_PACKED` names.
    ///
    /// # Panics
    /// When the variable is not set, or the image is missing, outdated or for another chip.
    pub(crate) fn image(self) -> Image {
        let word = self.key.to_uppercase().replace('-', "_");
        let variable = format!("CORTICODE_IMAGE_{word}");
        let path = env::var_os(&variable).unwrap_or_else(|| {
            panic!(
                "{variable} is not set; `cargo xtask board {}` builds the images and runs these tests",
                self.model.key()
            )
        });
        Image::read(Path::new(&path), self.model).unwrap_or_else(|error| panic!("{error}"))
    }
}

impl fmt::Display for Subject {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.key)
    }
}
