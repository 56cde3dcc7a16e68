//! The trained artifact on disk, and the float network that it describes.
//!
//! One folder holds everything that training decides: not only the weights, but also the filters,
//! the montage and the scale of the input, so that no other file repeats them.
//!
//! ```text
//! trainer --> folder --Artifact::read--> Artifact --> model-gen: integers for the device
//!                                           |
//!            window --> FloatEncoder --> code --> FloatDecoder --> window
//! ```
//!
//! | File | Contents | Part of the model id |
//! | --- | --- | --- |
//! | `model.toml` | [`Description`]: mode, shapes, rates, filters, montage, training card | yes |
//! | `weights.safetensors` | encoder and decoder, f32, with PyTorch's names and shapes; not in mode `packed` | yes |
//! | `calibration.safetensors` | ranges from which model-gen derives the int8 scales, f32 | yes |
//! | `packed.toml`, `packed.safetensors` | [`PackedModel`]: the packed code; optional, in mode `packed` the whole model | yes |
//! | `substitution.toml`, `substitution.safetensors` | [`SubstitutionTable`]: prediction of each electrode from the others; optional | yes |
//! | `golden.safetensors` | int8 windows and their codes ([`Golden`]); not in mode `packed` | no: it tests the model |
//! | `pca.safetensors` | PCA of the training windows ([`Pca`]); optional | no: the model is compared with it |
//!
//! [`FloatEncoder`] and [`FloatDecoder`] run the network in f32 with plain loops. The encoder is
//! the reference for the integer encoder; the bridge uses the decoder.
//!
//! ```
//! use artifact::{Artifact, FloatDecoder, FloatEncoder};
//! use std::path::Path;
//!
//! let folder = Path::new("../../signal/model/artifact");
//! let artifact = Artifact::read(folder)?;
//! let dimensions = artifact.description.dimensions();
//! let code = FloatEncoder::new(&artifact)?.encode(&vec![0.0; dimensions.window_cells()]);
//! let window = FloatDecoder::new(&artifact)?.decode(&code);
//! assert_eq!(window.len(), dimensions.window_electrodes());
//! // A window of zeros is reconstructed to within a tenth of the training data's standard deviation.
//! assert!(window.iter().all(|electrode| electrode.abs() < 0.1));
//! # Ok::<(), artifact::ArtifactError>(())
//! ```
#![forbid(unsafe_code)]

pub mod classifier;
mod convolution;
mod description;
mod error;
mod float_decoder;
mod float_encoder;
mod folder;
mod geometry;
mod golden;
mod integer_code;
mod model_id;
mod montage_file;
mod packed;
mod pca;
pub mod reconstruction;
mod scalp_grid;
mod shapes;
mod substitution;
mod tensor_file;
mod tensors;
mod unpooled_convolution;
mod validation;

#[cfg(test)]
mod testing;

pub use description::{
    Adc, AdcClock, AdcControl, AdcWiring, CodeFormat, CodeQuantisation, Decimation, Description,
    EMPTY, Figures, Filters, Grid, Input, Mode, Montage, NetworkShape, Padding, Person,
    TestedPerson, TrainingCard, Window,
};
pub use error::{ArtifactError, List, TensorProblem};
pub use float_decoder::FloatDecoder;
pub use float_encoder::{FloatEncoder, TracedCode};
pub use folder::{Artifact, HEAD_ROOM, embedding};
pub use geometry::{CONV1_CHANNELS, CONV2_CHANNELS, Dimensions, Geometry, KERNEL};
pub use golden::Golden;
pub use integer_code::IntegerCode;
pub use model_id::ModelId;
pub use montage_file::{MontageAdc, MontageFile, MontageFileError};
pub use packed::{
    ErrorWeight, INPUTS_PER_ROUND, IntegerMatrix, LARGEST_STATE, PackedDescription, PackedFigures,
    PackedModel, PackedTraining, SUM_LIMIT, Smoother, rounded_state, slice_ends,
};
pub use pca::Pca;
pub use scalp_grid::ScalpGrid;
pub use shapes::{NORM_EPSILON, NamedShape, calibration_shapes, weight_shapes};
pub use substitution::{
    LARGEST_INNOVATION, SubstitutionDescription, SubstitutionFigures, SubstitutionTable,
    SubstitutionTraining,
};
pub use tensors::Tensors;
pub use validation::{
    ADC_RATES_HZ, CHIP_CHANNELS, ELECTRODES, GAINS, LARGEST_CHAIN, LARGEST_SIDE, check_description,
};
