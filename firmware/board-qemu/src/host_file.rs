//! A file of the host that runs the emulation.
#![expect(unsafe_code, reason = "semihosting calls take addresses")]

use cortex_m_semihosting::{nr, syscall};

/// A file of the host, open for reading.
#[derive(Debug)]
pub(crate) struct HostFile(usize);

impl HostFile {
    /// Opens a file of the emulator's working folder, if it is there.
    pub(crate) fn open(name: &core::ffi::CStr) -> Option<Self> {
        let length = name.to_bytes().len();
        // SAFETY: SYS_OPEN reads the name and its length from an argument block that outlives it.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), nr::open::R_BINARY, length) };
        (handle != usize::MAX).then_some(Self(handle))
    }

    /// Fills the buffer; false where the file ends before.
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> bool {
        // SAFETY: SYS_READ writes at most `len` bytes into the buffer, which is borrowed for it.
        let missing = unsafe { syscall!(READ, self.0, buffer.as_mut_ptr(), buffer.len()) };
        missing == 0
    }
}
