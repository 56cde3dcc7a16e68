//! The NUCLEO boards on emulated microcontrollers.
