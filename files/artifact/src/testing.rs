//! Small artificial models for the tests of this crate.

use crate::description::{Description, Mode};
use crate::folder::Artifact;
use crate::geometry::Geometry;
use crate::shapes::{calibration_shapes, weight_shapes};
use crate::tensors::Tensors;

/// Returns the description of the built-in model for 61 electrodes, with the mode `pca`.
pub(crate) fn description() -> Description {
    let paper = include_str!("../../../signal/model/paper/model.toml");
    let paper: Description = toml::from_str(paper).unwrap();
    Description { mode: Mode::Pca, ..paper }
}

fn calibration(description: &Description) -> Tensors {
    let mut calibration = Tensors::for_calibration();
    for (name, shape) in calibration_shapes(description.mode, &description.dimensions()) {
        let value = if name == "code.min" { -1.0 } else { 1.0 };
        calibration.insert(name, &shape, vec![value; shape.iter().product()]);
    }
    calibration
}

/// Returns a model of mode `pca` whose component k is value k of the window.
pub(crate) fn pca() -> Artifact {
    pca_with(description())
}

/// Returns the model of [`pca`], but with the dimensions in `description`.
pub(crate) fn pca_with(mut description: Description) -> Artifact {
    description.mode = Mode::Pca;
    let numbers = description.dimensions().numbers;
    let window = description.dimensions().window_electrodes();
    let mut weights = Tensors::for_weights();
    let mut encoder = vec![0.0; numbers * window];
    let mut decoder = encoder.clone();
    for component in 0..numbers.min(window) {
        encoder[component * window + component] = 1.0;
        decoder[component * numbers + component] = 1.0;
    }
    weights.insert("encoder.shortcut.weight", &[numbers, window], encoder);
    weights.insert("decoder.shortcut.weight", &[window, numbers], decoder);
    let calibration = calibration(&description);
    Artifact::new(description, weights, calibration).unwrap()
}

/// Returns a model of mode `shortcut` whose weights are all 1.
pub(crate) fn shortcut() -> Artifact {
    shortcut_with(description())
}

/// Returns the model of [`shortcut`] with the padding and the pool of `description`.
pub(crate) fn shortcut_with(mut description: Description) -> Artifact {
    description.mode = Mode::Shortcut;
    let mut weights = Tensors::for_weights();
    for (name, shape) in weight_shapes(Mode::Shortcut, &Geometry::new(&description)) {
        weights.insert(name, &shape, vec![1.0; shape.iter().product()]);
    }
    let calibration = calibration(&description);
    Artifact::new(description, weights, calibration).unwrap()
}
