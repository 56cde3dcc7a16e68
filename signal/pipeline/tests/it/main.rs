//! Tests of filters and front end against float and scipy references.
#![forbid(unsafe_code)]

mod filters;
mod front_end;
