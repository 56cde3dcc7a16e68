//! The front end at every sampling rate, literal and alias-free: against scipy, what it folds, how
//! late it is.
#![forbid(unsafe_code)]

mod aliases;
mod at_rate;
mod delay;
mod rates;
