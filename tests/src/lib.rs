//! What the whole promises, end to end.
#![forbid(unsafe_code)]
