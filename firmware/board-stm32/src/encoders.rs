//! The encoders of the image, which the features `network` and `packed` select.

/// Network and packed code.
#[cfg(all(feature = "network", feature = "packed"))]
pub(crate) type Encoders = device::BothEncoders;

/// The network alone.
#[cfg(all(feature = "network", not(feature = "packed")))]
pub(crate) type Encoders = pipeline::EncoderMemory;

/// The packed code alone.
#[cfg(all(feature = "packed", not(feature = "network")))]
pub(crate) type Encoders = pipeline::PackedMemory;

#[cfg(not(any(feature = "network", feature = "packed")))]
compile_error!("an image without encoders: select the feature `network`, `packed` or both");
