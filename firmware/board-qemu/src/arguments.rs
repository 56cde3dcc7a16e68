//! What the emulator was started with.
#![expect(unsafe_code, reason = "a semihosting call takes an address")]

/// SYS_GET_CMDLINE (ARM semihosting, section 7.7).
const GET_CMDLINE: usize = 0x15;

/// Longest line.
const LONGEST: usize = 128;

/// The words behind QEMU's `-semihosting-config arg=`.
#[derive(Debug)]
pub(crate) struct Arguments {
    line: [u8; LONGEST],
}

impl Arguments {
    /// Asks the emulator.
    pub(crate) fn of_emulator() -> Self {
        let mut line = [0; LONGEST];
        let block = [line.as_mut_ptr() as usize, LONGEST];
        // SAFETY: the call writes at most as many bytes as the block says into the line, and its
        // length into the block; both outlive it.
        let refused =
            unsafe { cortex_m_semihosting::syscall1(GET_CMDLINE, block.as_ptr() as usize) };
        let _ = refused;
        Self { line }
    }

    /// Whether `word` is among them.
    pub(crate) fn has(&self, word: &str) -> bool {
        let end = self.line.iter().position(|&byte| byte == 0);
        let line = &self.line[..end.unwrap_or(LONGEST)];
        line.split(|&byte| byte == b' ')
            .any(|argument| argument == word.as_bytes())
    }
}
