//! Commands to the device, the streams they ask for, and their names in messages to the user.

pub(crate) mod commands;
pub(crate) mod self_test;
pub(crate) mod upload;
pub(crate) mod wanted;
pub(crate) mod words;
