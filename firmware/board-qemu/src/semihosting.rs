//! Arguments and files from the PC that runs the emulator, by semihosting.
#![expect(unsafe_code, reason = "semihosting calls take addresses")]

use cortex_m_semihosting::{nr, syscall, syscall1};

/// Number of the semihosting call SYS_GET_CMDLINE (ARM semihosting, section 7.7).
const GET_CMDLINE: usize = 0x15;

/// Size of the buffer for the command line, bytes. If the command line is longer, QEMU leaves the
/// buffer empty, and the image runs as if it had no arguments.
const MAX_LINE: usize = 128;

/// Arguments that QEMU was started with, as `-semihosting-config arg=`.
#[derive(Debug)]
pub(crate) struct Arguments {
    line: [u8; MAX_LINE],
}

impl Arguments {
    pub(crate) fn read() -> Self {
        let mut line = [0; MAX_LINE];
        let mut block = [line.as_mut_ptr() as usize, MAX_LINE];
        // SAFETY: the call writes at most MAX_LINE bytes to `line`, and the length of the command
        // line to `block`. Both are local variables of this function, so they live until the call
        // has returned.
        let _ = unsafe { syscall1(GET_CMDLINE, block.as_mut_ptr() as usize) };
        Self { line }
    }

    /// Returns whether `word` is one of the arguments, which are separated by single spaces.
    pub(crate) fn has(&self, word: &str) -> bool {
        let end = self.line.iter().position(|&byte| byte == 0);
        let line = &self.line[..end.unwrap_or(MAX_LINE)];
        line.split(|&byte| byte == b' ').any(|argument| argument == word.as_bytes())
    }
}

/// File on the PC, open for reading; the field is the handle that the emulator assigned to the
/// file.
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
