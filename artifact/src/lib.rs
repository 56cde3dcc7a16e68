//! The trained artifact on disk, and the float network that it describes.
//!
//! Everything that training decided travels in one folder: the network's weights, but also the
//! filters, the montage and the scale of its input, so that nothing has to be repeated elsewhere.
//!
//! | File | Holds | In the model id |
//! | --- | --- | --- |
//! | `model.toml` | [`Description`]: mode, shapes, rates, filters, montage, training card | yes |
//! | `weights.safetensors` | encoder and decoder, f32, PyTorch's names and shapes | yes |
//! | `calibration.safetensors` | the ranges from which `model-gen` chooses its int8 scales, f32 | yes |
//! | `golden.safetensors` | int8 windows and their codes ([`Golden`]) | no: a check of that model |
//!
//! `model-gen` turns an [`Artifact`] into integers for the device. [`FloatEncoder`] and
//! [`FloatDecoder`] run the same network in f32 and plain loops: the oracle of the integer encoder,
//! and the decoder of the bridge.
#![forbid(unsafe_code)]
#![cfg_attr(
    test,
    expect(
        clippy::float_cmp,
        clippy::cast_precision_loss,
        reason = "the hand-made cases are small integers, which f32 holds exactly"
    )
)]

mod convolution;
mod description;
mod error;
mod float_decoder;
mod float_encoder;
mod folder;
mod geometry;
mod golden;
mod input_scale;
mod integer_code;
mod model_id;
mod scalp_grid;
mod shapes;
mod tensors;
mod training_card;
mod validation;

#[cfg(test)]
mod testing;

pub use description::{
    Adc, CodeFormat, CodeQuantisation, Decimation, Description, Filters, Grid, Input, Mode,
    Montage, NetworkShape, Padding, Window,
};
pub use error::ArtifactError;
pub use float_decoder::FloatDecoder;
pub use float_encoder::{FloatEncoder, Traced};
pub use folder::Artifact;
pub use geometry::Geometry;
pub use golden::Golden;
pub use input_scale::HEAD_ROOM;
pub use integer_code::IntegerCode;
pub use model_id::ModelId;
pub use scalp_grid::ScalpGrid;
pub use shapes::{
    CELLS, CODE, COLUMNS, ELECTRODES, NORM_EPSILON, NamedShape, ROWS, STEPS, WINDOW_CELLS,
    WINDOW_ELECTRODES, weight_shapes,
};
pub use tensors::Tensors;
pub use training_card::{Figures, TrainingCard};
