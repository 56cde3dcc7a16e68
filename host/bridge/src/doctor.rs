//! Checks of what a laboratory needs before the bridge runs: pure functions of facts about the
//! machine, which the program collects.

pub(crate) mod check;
pub(crate) mod device_checks;
pub(crate) mod machine_checks;
pub(crate) mod port_checks;
pub(crate) mod probe;
pub(crate) mod ros_checks;
