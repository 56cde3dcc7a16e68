//! The float network, which decodes codes to microvolts and audits the device's codes.

pub(crate) mod audit;
pub(crate) mod back_pressure;
pub(crate) mod model;
pub(crate) mod packed;
pub(crate) mod reconstruction;
pub(crate) mod thread;
