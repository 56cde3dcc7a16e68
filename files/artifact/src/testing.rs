//! Small artificial models for the tests of this crate.

use crate::description::{Description, Mode};
use crate::folder::Artifact;
use crate::geometry::Geometry;
use crate::shapes::{NORM_EPSILON, calibration_shapes, weight_shapes};
use crate::tensors::Tensors;

/// Returns the description of the built-in model for 61 electrodes, but with mode `pca`.
pub(crate) fn description() -> Description {
    let paper = include_str!("../../../signal/model/paper/model.toml");
    let paper: Description = toml::from_str(paper).unwrap();
    Description {
        mode: Mode::Pca,
        ..paper
    }
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

/// Returns a model of mode `shortcut` with few non-zero weights, so that results can be computed by
/// hand.
pub(crate) fn shortcut() -> Artifact {
    shortcut_with(description())
}

/// Returns the model of [`shortcut`], but with the padding and the pool in `description`.
pub(crate) fn shortcut_with(mut description: Description) -> Artifact {
    description.mode = Mode::Shortcut;
    let expected = weight_shapes(Mode::Shortcut, &Geometry::new(&description));
    let mut weights = Tensors::for_weights();
    for (name, shape) in &expected {
        let value = match name.rsplit_once('.') {
            Some((_, "running_var")) => 1.0 - NORM_EPSILON,
            Some((norm, "weight")) if norm.contains("norm") => 2.0,
            Some((norm, "bias")) if norm.contains("norm") => 0.25,
            _ => 0.0,
        };
        weights.insert(name, shape, vec![value; shape.iter().product()]);
    }
    let mut set = |name: &str, range: core::ops::Range<usize>, value: f32| {
        let (_, shape) = expected.iter().find(|(known, _)| *known == name).unwrap();
        let mut values = weights.tensor(name, shape).unwrap().to_vec();
        values[range].fill(value);
        weights.insert(name, shape, values);
    };
    set("encoder.conv1.weight", 0..27, 1.0);
    set("encoder.conv1.bias", 0..1, 0.5);
    set("encoder.conv2.weight", 13..14, 0.1);
    set("encoder.fc.weight", 0..1, 1.0);
    set("encoder.fc.bias", 0..1, 1.0);
    set("decoder.fc.weight", 0..1, 1.0);
    set("decoder.conv1.weight", 0..1, 1.0);
    set("decoder.conv2.weight", 26..27, 1.0);
    set("decoder.conv2.bias", 0..1, -0.5);
    let calibration = calibration(&description);
    Artifact::new(description, weights, calibration).unwrap()
}
