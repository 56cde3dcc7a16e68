//! The host's clocks, and the device's clock fitted to them.

pub(crate) mod clock;
pub(crate) mod host_time;
mod hull;
pub(crate) mod round_trip;
