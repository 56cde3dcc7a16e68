//! Arguments that the emulator was started with.
#![expect(unsafe_code, reason = "a semihosting call takes an address")]

/// SYS_GET_CMDLINE (ARM semihosting, section 7.7).
const GET_CMDLINE: usize = 0x15;

/// Size of the buffer for the command line, bytes. QEMU refuses to fill it with a longer line, and
/// then there are no arguments.
const MAX_LINE: usize = 128;

/// Arguments that QEMU was started with, as `-semihosting-config arg=`.
#[derive(Debug)]
pub(crate) struct Arguments {
    line: [u8; MAX_LINE],
}

impl Arguments {
    /// Reads the arguments from the emulator.
    pub(crate) fn read() -> Self {
        let mut line = [0; MAX_LINE];
        let mut block = [line.as_mut_ptr() as usize, MAX_LINE];
        // SAFETY: the call writes at most MAX_LINE bytes to `line`, and the length of the command
        // line to `block`. Both are local variables of this function, so they live until the call
        // has returned.
        let refused =
            unsafe { cortex_m_semihosting::syscall1(GET_CMDLINE, block.as_mut_ptr() as usize) };
        let _ = refused;
        Self { line }
    }

    /// Compares `word` with whole arguments, which are separated by single spaces.
    pub(crate) fn has(&self, word: &str) -> bool {
        let end = self.line.iter().position(|&byte| byte == 0);
        let line = &self.line[..end.unwrap_or(MAX_LINE)];
        line.split(|&byte| byte == b' ')
            .any(|argument| argument == word.as_bytes())
    }
}
