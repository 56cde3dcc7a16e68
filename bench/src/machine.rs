//! The emulated board: a clock that counts instructions, and the host's files.
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

/// Counter 1 of the board's dual timer (CMSDK, ARM DDI 0479; its place in the FPGA images AN386 and
/// AN500 of the MPS2).
const LOAD: *mut u32 = 0x4000_2000 as *mut u32;
const VALUE: *const u32 = 0x4000_2004 as *const u32;
const CONTROL: *mut u32 = 0x4000_2008 as *mut u32;
/// Enabled, free running, no interrupt, prescaler 1, 32 bits.
const FREE_RUNNING: u32 = 0b1000_0010;

/// With QEMU's `-icount shift=10` an instruction lasts 1024 ns, which is 25.6 periods of the board's
/// 25 MHz: 256 ticks for ten instructions.
const TICKS_OF_TEN: u64 = 256;

/// Instructions in the block that the clock is tried on.
const KNOWN: u32 = 1000;

/// Counts instructions.
#[derive(Debug)]
pub struct Clock {
    /// Instructions that a measurement of nothing counts.
    overhead: u32,
}

impl Clock {
    /// Starts the timer, measures what a measurement costs, and tries both on a block of 1000
    /// instructions.
    ///
    /// # Errors
    /// With the count of that block when it is not 1000: the machine is not started as it must be.
    pub fn start() -> Result<Self, u32> {
        for (register, value) in [(LOAD, u32::MAX), (CONTROL, FREE_RUNNING)] {
            // SAFETY: both are registers of the dual timer, which nothing else here uses.
            unsafe { register.write_volatile(value) };
        }
        let mut clock = Self { overhead: 0 };
        clock.overhead = clock.count(&mut || {});
        let known = clock.count(&mut || {
            // SAFETY: does nothing, a known number of times.
            unsafe { asm!(".rept {}", "nop", ".endr", const KNOWN, options(nomem, nostack)) };
        });
        if known == KNOWN {
            Ok(clock)
        } else {
            Err(known)
        }
    }

    /// Instructions that `work` takes, without its own call and return; fewer than 2^27, where the
    /// timer wraps.
    ///
    /// One function for everything that is counted: inlined, the compiler would mix it with what
    /// surrounds it, and every measurement would cost something else.
    #[inline(never)]
    pub fn count(&self, work: &mut dyn FnMut()) -> u32 {
        let begin = ticks();
        compiler_fence(Ordering::SeqCst);
        work();
        compiler_fence(Ordering::SeqCst);
        let elapsed = u64::from(ticks().wrapping_sub(begin));
        let instructions = (elapsed * 10 + TICKS_OF_TEN / 2) / TICKS_OF_TEN;
        u32::try_from(instructions)
            .unwrap_or(u32::MAX)
            .wrapping_sub(self.overhead)
    }
}

/// Starts the clock, does the image's work with it, and ends the emulation: with 1, and a reason, when
/// the machine is not started as it must be or the host's files are not there.
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
        hprintln!("the host does not give {} or take {}", INPUTS, OUTPUTS);
    }
    exit(done.is_ok())
}

/// Ticks since the timer's start; wraps.
#[inline]
fn ticks() -> u32 {
    // SAFETY: a register of the dual timer; reading has no effect.
    !unsafe { VALUE.read_volatile() }
}

/// A file of the host.
#[derive(Debug)]
pub struct HostFile(usize);

/// The host refused: no such file, its end, no space.
#[derive(Clone, Copy, Debug)]
pub struct Refused;

impl HostFile {
    /// Opens a file of the emulator's working folder for reading.
    ///
    /// # Errors
    /// The host cannot.
    pub fn open(name: &str) -> Result<Self, Refused> {
        Self::with_mode(name, nr::open::R_BINARY)
    }

    /// Makes a file there, or empties it.
    ///
    /// # Errors
    /// The host cannot.
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

    /// Fills the buffer; false at the end of the file.
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

    /// Writes all bytes.
    ///
    /// # Errors
    /// The host cannot.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        // SAFETY: SYS_WRITE reads `len` bytes from the slice, which is borrowed for it.
        let missing = unsafe { syscall!(WRITE, self.0, bytes.as_ptr(), bytes.len()) };
        if missing == 0 { Ok(()) } else { Err(Refused) }
    }
}

/// Ends the emulation; the emulator's exit status says whether all went well.
pub fn exit(well: bool) -> ! {
    loop {
        debug::exit(if well {
            debug::EXIT_SUCCESS
        } else {
            debug::EXIT_FAILURE
        });
    }
}
