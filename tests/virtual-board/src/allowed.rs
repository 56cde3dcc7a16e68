//! What the emulator may notice without a fault of the firmware.
