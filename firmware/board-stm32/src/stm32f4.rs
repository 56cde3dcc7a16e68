//! What the boards with a chip of the family STM32F4 share: clocks, the timer at the HSE input, the
//! cause of a reset, registers of a UART, and a number for the session.

mod clocks;
mod hse_timer;
mod reset;
mod session_id;
pub mod uart;

pub use clocks::{AFTER_RESET_HZ, config, enable_flash_accelerator};
pub use hse_timer::Timer as HseTimer;
pub use reset::{freeze_watchdog_in_debug, map_system_memory, take_cause};
pub use session_id::session_id;
