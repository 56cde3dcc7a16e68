//! Files of the PC that runs the emulator.
#![expect(unsafe_code, reason = "semihosting calls take addresses")]

use cortex_m_semihosting::{nr, syscall};

/// Handle of a file on the PC, open for reading.
#[derive(Debug)]
pub(crate) struct HostFile(usize);

impl HostFile {
    /// Opens a file in the emulator's working directory. Returns `None` if there is no such file.
    pub(crate) fn open(name: &core::ffi::CStr) -> Option<Self> {
        let length = name.to_bytes().len();
        // SAFETY: SYS_OPEN reads `length` bytes and a zero at `name`, which is borrowed until the
        // call returns. The macro's argument block is a temporary that lives as long.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), nr::open::R_BINARY, length) };
        (handle != usize::MAX).then_some(Self(handle))
    }

    /// Fills the buffer from the file. Returns false if the file ends before the buffer is full.
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> bool {
        // SAFETY: SYS_READ writes at most `buffer.len()` bytes to `buffer`, which is mutably
        // borrowed until the call returns. The macro's argument block is a temporary that lives as
        // long.
        let missing = unsafe { syscall!(READ, self.0, buffer.as_mut_ptr(), buffer.len()) };
        missing == 0
    }
}
