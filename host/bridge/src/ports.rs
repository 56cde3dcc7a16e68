//! The serial ports of this machine, and the boards among them.

pub(crate) mod access;
pub(crate) mod finder;
pub(crate) mod holders;
pub(crate) mod serial_port;
#[cfg(test)]
pub(crate) mod simulated_machine;
pub(crate) mod system_root;
