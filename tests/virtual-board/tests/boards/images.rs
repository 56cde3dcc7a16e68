//! The images that run, by environment.

use std::env;
use std::path::Path;

use virtual_board::{Image, Model};

/// The image of a board: the file that `CORTICODE_IMAGE_H743` or `CORTICODE_IMAGE_F446` names.
///
/// # Panics
/// When there is none, or it is stale or for another chip: these tests are about an image.
pub(crate) fn image(model: Model) -> Image {
    let variable = format!("CORTICODE_IMAGE_{}", model.key().to_uppercase());
    let path = env::var_os(&variable).unwrap_or_else(|| {
        panic!(
            "{variable} names no image; `cargo xtask board {}` builds one and runs these tests with it",
            model.key()
        )
    });
    Image::read(Path::new(&path), model).unwrap_or_else(|error| panic!("{error}"))
}
