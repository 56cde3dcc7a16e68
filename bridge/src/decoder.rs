//! The float network on the host: codes back to microvolts, and audits of the device's codes.

pub(crate) mod audit;
pub(crate) mod model;
pub(crate) mod reconstruction;
pub(crate) mod thread;
