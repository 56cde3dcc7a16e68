//! The encoders of the image, which the features `network` and `packed` select.

/// Network and packed code.
#[cfg(all(feature = "network", feature = "packed"))]
pub(crate) type ImageEncoders = device::BothEncoders;

/// The network alone.
#[cfg(all(feature = "network", not(feature = "packed")))]
pub(crate) type ImageEncoders = pipeline::EncoderMemory;

/// The packed code alone.
#[cfg(all(feature = "packed", not(feature = "network")))]
pub(crate) type ImageEncoders = pipeline::PackedMemory;

#[cfg(not(any(feature = "network", feature = "packed")))]
compile_error!("an image without encoders: select the feature `network`, `packed` or both");
