//! The front end at every sampling rate and decimation: comparison with scipy, aliases, delay.
#![forbid(unsafe_code)]

mod aliases;
mod at_rate;
mod delay;
mod rates;
