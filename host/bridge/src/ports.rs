//! The serial ports of this machine, and the boards among them.

pub(crate) mod access;
pub(crate) mod finder;
#[cfg(test)]
pub(crate) mod simulated_machine;
pub(crate) mod system_root;
