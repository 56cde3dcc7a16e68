//! The trained artifact on disk, and the float network that it describes.
#![forbid(unsafe_code)]
