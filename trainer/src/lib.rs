//! Trains the convolutional autoencoder and writes the artifact.
#![forbid(unsafe_code)]
