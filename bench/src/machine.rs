//! The emulated board: an instruction counter and files of the host.
#![expect(
    unsafe_code,
    reason = "the timer's registers, semihosting calls and a block of known length in assembler"
)]

use core::{
    arch::asm,
    sync::atomic::{Ordering, compiler_fence},
};

use cortex_m_semihosting::{debug, hprintln, nr, syscall};

use crate::block::{INPUTS, OUTPUTS};

/// Reload register of timer 1 of the board's dual timer (CMSDK, ARM DDI 0479; addresses of the MPS2's FPGA images
/// AN386 and AN500).
const LOAD: *mut u32 = 0x4000_2000 as *mut u32;
/// Current value of timer 1 of the dual timer, counting down.
const VALUE: *const u32 = 0x4000_2004 as *const u32;
/// Control register of timer 1 of the dual timer.
const CONTROL: *mut u32 = 0x4000_2008 as *mut u32;
/// Value of [`CONTROL`]: enabled, free running, no interrupt, prescaler 1, 32 bits.
const FREE_RUNNING: u32 = 0b1000_0010;

/// Timer ticks of ten instructions: with QEMU's `-icount shift=10` an instruction takes 1024 ns, which is 25.6
/// periods of the board's 25 MHz clock.
const TICKS_OF_TEN: u64 = 256;

/// Length of the block of instructions with which the counter is checked.
const KNOWN: u32 = 1000;

/// Instruction counter, based on the timer.
#[derive(Debug)]
pub struct Clock {
    /// Number of instructions counted for an empty closure.
    overhead: u32,
}

impl Clock {
    /// Starts the timer, measures the overhead of a measurement, and checks both with a block of 1000
    /// instructions.
    ///
    /// # Errors
    /// Returns the count of that block when it is not 1000: QEMU runs with other options than needed.
    pub fn start() -> Result<Self, u32> {
        for (register, value) in [(LOAD, u32::MAX), (CONTROL, FREE_RUNNING)] {
            // SAFETY: both are registers of the dual timer, which nothing else here uses.
            unsafe { register.write_volatile(value) };
        }
        let mut clock = Self { overhead: 0 };
        clock.overhead = clock.count(&mut || {});
        let known = clock.count(&mut || {
            // SAFETY: executes NOPs only.
            unsafe { asm!(".rept {}", "nop", ".endr", const KNOWN, options(nomem, nostack)) };
        });
        if known == KNOWN {
            Ok(clock)
        } else {
            Err(known)
        }
    }

    /// Counts the instructions of `work` without its call and return. The timer wraps at 2^27 instructions.
    ///
    /// Not inlined: the compiler would mix it with the surrounding code, and each measurement would have another
    /// overhead.
    #[inline(never)]
    pub fn count(&self, work: &mut dyn FnMut()) -> u32 {
        let start = ticks();
        compiler_fence(Ordering::SeqCst);
        work();
        compiler_fence(Ordering::SeqCst);
        let elapsed = u64::from(ticks().wrapping_sub(start));
        let instructions = (elapsed * 10 + TICKS_OF_TEN / 2) / TICKS_OF_TEN;
        u32::try_from(instructions)
            .unwrap_or(u32::MAX)
            .wrapping_sub(self.overhead)
    }
}

/// Starts the counter, runs the image's `work` with it, and ends the emulation. The exit status is 1, with a printed
/// reason, when the counter is wrong or a file of the host cannot be used.
pub fn with_clock(work: impl FnOnce(&Clock) -> Result<(), Refused>) -> ! {
    let clock = match Clock::start() {
        Ok(clock) => clock,
        Err(count) => {
            hprintln!(
                "1000 instructions count as {}: is QEMU started with -icount shift=10?",
                count
            );
            exit(false)
        }
    };
    let done = work(&clock);
    if done.is_err() {
        hprintln!(
            "cannot read {} or cannot write {} on the host",
            INPUTS,
            OUTPUTS
        );
    }
    exit(done.is_ok())
}

/// Returns the ticks since the timer's start, modulo 2^32.
#[inline]
fn ticks() -> u32 {
    // SAFETY: a register of the dual timer; reading it has no side effect.
    !unsafe { VALUE.read_volatile() }
}

/// A file on the host, accessed through semihosting.
#[derive(Debug)]
pub struct HostFile(usize);

/// The host refused an operation: the file is missing or too short, or the disk is full.
#[derive(Clone, Copy, Debug)]
pub struct Refused;

impl HostFile {
    /// Opens a file in the emulator's working folder for reading.
    ///
    /// # Errors
    /// The file does not exist or cannot be read.
    pub fn open(name: &str) -> Result<Self, Refused> {
        Self::with_mode(name, nr::open::R_BINARY)
    }

    /// Creates a file in the emulator's working folder, or truncates it.
    ///
    /// # Errors
    /// The folder or the file is not writable.
    pub fn create(name: &str) -> Result<Self, Refused> {
        Self::with_mode(name, nr::open::W_TRUNC_BINARY)
    }

    fn with_mode(name: &str, mode: usize) -> Result<Self, Refused> {
        let mut terminated = [0; 32];
        let space = terminated.get_mut(..name.len()).ok_or(Refused)?;
        space.copy_from_slice(name.as_bytes());
        // SAFETY: SYS_OPEN reads the name and its length from an argument block that outlives it.
        let handle = unsafe { syscall!(OPEN, terminated.as_ptr(), mode, name.len()) };
        if handle == usize::MAX {
            Err(Refused)
        } else {
            Ok(Self(handle))
        }
    }

    /// Fills the buffer and returns true, or returns false at the end of the file.
    ///
    /// # Errors
    /// The file ends within the buffer, or cannot be read.
    pub fn read(&mut self, buffer: &mut [u8]) -> Result<bool, Refused> {
        // SAFETY: SYS_READ writes at most `len` bytes into the buffer, which is borrowed for it.
        let missing = unsafe { syscall!(READ, self.0, buffer.as_mut_ptr(), buffer.len()) };
        match missing {
            0 => Ok(true),
            missing if missing == buffer.len() => Ok(false),
            _ => Err(Refused),
        }
    }

    /// Appends all bytes.
    ///
    /// # Errors
    /// The disk is full or the host reports another error.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        // SAFETY: SYS_WRITE reads `len` bytes from the slice, which is borrowed for it.
        let missing = unsafe { syscall!(WRITE, self.0, bytes.as_ptr(), bytes.len()) };
        if missing == 0 { Ok(()) } else { Err(Refused) }
    }
}

/// Ends the emulation; QEMU exits with status 0 on success and 1 otherwise.
pub fn exit(success: bool) -> ! {
    loop {
        debug::exit(if success {
            debug::EXIT_SUCCESS
        } else {
            debug::EXIT_FAILURE
        });
    }
}
