//! Access of an image to the emulated board: an instruction counter, and files of the PC.
#![expect(
    unsafe_code,
    reason = "the timer's registers, semihosting calls and a block of known length in assembler"
)]

use core::{
    arch::asm,
    fmt,
    panic::PanicInfo,
    sync::atomic::{Ordering, compiler_fence},
};

use cortex_m_semihosting::{debug, hprintln, nr, syscall};

use crate::block::{INPUTS, OUTPUTS};

/// Address of the load register of timer 1 in the dual timer. ARM DDI 0479 (CMSDK) documents the
/// registers, the application notes of the FPGA images AN386 and AN500 the addresses.
const LOAD: *mut u32 = 0x4000_2000 as *mut u32;
/// Address of the current value of timer 1, which counts down.
const VALUE: *const u32 = 0x4000_2004 as *const u32;
/// Address of the control register of the dual timer's timer 1.
const CONTROL: *mut u32 = 0x4000_2008 as *mut u32;
/// Value of the register at [`CONTROL`]: enabled, free running, no interrupt, prescaler 1, 32 bits.
const FREE_RUNNING: u32 = 0b1000_0010;

/// Number of timer ticks in ten instructions. With QEMU's `-icount shift=10` an instruction takes
/// 1024 ns, which is 25.6 periods of the board's 25 MHz clock.
const TICKS_OF_TEN: u64 = 256;

/// Number of instructions in the block of code that checks the counter.
const KNOWN: u32 = 1000;

/// Counter of executed instructions, based on the emulated timer.
#[derive(Debug)]
pub struct Clock {
    /// Number of instructions that an empty closure counts, which every measurement contains.
    overhead: u32,
}

impl Clock {
    /// Starts the timer, measures the overhead of a measurement, and checks timer and overhead with
    /// a block of 1000 instructions.
    ///
    /// # Errors
    /// Returns the number of instructions counted for the block if it is not 1000, which means that
    /// QEMU was not started with the options that the counter needs.
    pub fn start() -> Result<Self, u32> {
        for (register, value) in [(LOAD, u32::MAX), (CONTROL, FREE_RUNNING)] {
            // SAFETY: `LOAD` and `CONTROL` are addresses of registers of the dual timer, which only
            // this file uses.
            unsafe { register.write_volatile(value) };
        }
        let mut clock = Self { overhead: 0 };
        clock.overhead = clock.count(&mut || {});
        let known = clock.count(&mut || {
            // SAFETY: the block consists of NOPs, which touch neither memory nor registers.
            unsafe { asm!(".rept {}", "nop", ".endr", const KNOWN, options(nomem, nostack)) };
        });
        if known == KNOWN { Ok(clock) } else { Err(known) }
    }

    /// Returns the number of instructions that `work` executes, without its call and return. The
    /// timer wraps after 2^32 ticks, which is 1.7e8 instructions.
    ///
    /// Not inlined: the compiler would mix this function with the surrounding code, and each
    /// measurement would have a different overhead.
    #[inline(never)]
    pub fn count(&self, work: &mut dyn FnMut()) -> u32 {
        let start = ticks();
        compiler_fence(Ordering::SeqCst);
        work();
        compiler_fence(Ordering::SeqCst);
        let elapsed = u64::from(ticks().wrapping_sub(start));
        let instructions = (elapsed * 10 + TICKS_OF_TEN / 2) / TICKS_OF_TEN;
        u32::try_from(instructions).unwrap_or(u32::MAX).wrapping_sub(self.overhead)
    }
}

/// Starts the counter, calls `work` with it, and ends the emulation. If the counter is wrong or a
/// file operation fails, prints the reason and ends with exit status 1.
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
        hprintln!("cannot read {} or cannot write {} on the host", INPUTS, OUTPUTS);
    }
    exit(done.is_ok())
}

/// Prints the panic and ends the emulation with exit status 1. For an image's panic handler.
pub fn panicked(info: &PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    exit(false)
}

/// Files on the PC through which an image reads inputs and writes outputs.
#[derive(Debug)]
pub struct Files {
    inputs: HostFile,
    /// File that the image writes, with the outputs of the code under test.
    pub outputs: HostFile,
}

impl Files {
    /// Opens the input file and creates the output file.
    ///
    /// # Errors
    /// The input file does not exist, or the output file cannot be written.
    pub fn open() -> Result<Self, Refused> {
        Ok(Self { inputs: HostFile::open(INPUTS)?, outputs: HostFile::create(OUTPUTS)? })
    }

    /// Reads the number of time steps in each input, with which some input files start.
    ///
    /// # Errors
    /// The file is empty or cannot be read.
    pub fn read_steps(&mut self) -> Result<usize, Refused> {
        let mut steps = [0; 4];
        let has_steps = self.inputs.read(&mut steps)?;
        has_steps.then_some(u32::from_le_bytes(steps) as usize).ok_or(Refused)
    }

    /// Reads an input's element `index` (block, plane or step); returns false at the end of the
    /// file.
    ///
    /// # Errors
    /// The file cannot be read, or ends within an input.
    pub fn read(&mut self, index: usize, element: &mut [u8]) -> Result<bool, Refused> {
        match self.inputs.read(element)? {
            false if index > 0 => Err(Refused),
            is_read => Ok(is_read),
        }
    }

    /// Calls `count` for each input until it returns `None` at the end of the file, and prints the
    /// results as the TOML array `inputs`.
    ///
    /// # Errors
    /// The first error of `count`.
    pub fn count_inputs<T: fmt::Debug>(
        &mut self,
        mut count: impl FnMut(&mut Self) -> Result<Option<T>, Refused>,
    ) -> Result<(), Refused> {
        hprintln!("inputs = [");
        while let Some(counts) = count(self)? {
            hprintln!("{:?},", counts);
        }
        hprintln!("]");
        Ok(())
    }
}

/// Returns the number of ticks since the timer's start, modulo 2^32.
#[inline]
fn ticks() -> u32 {
    // SAFETY: `VALUE` is the address of a register of the dual timer; reading it has no side
    // effect.
    !unsafe { VALUE.read_volatile() }
}

/// Handle of an open file on the PC, for semihosting calls.
#[derive(Debug)]
pub struct HostFile(usize);

/// Error: the PC refused a file operation, because the file is missing or too short, its name is
/// too long, or the disk is full.
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
        let mut terminated = [0; 33];
        let space = terminated[..32].get_mut(..name.len()).ok_or(Refused)?;
        space.copy_from_slice(name.as_bytes());
        // SAFETY: SYS_OPEN reads `name.len()` bytes and a zero at `terminated`, a local array that
        // lives until this function returns. The macro's argument block is a temporary that lives
        // until the call returns.
        let handle = unsafe { syscall!(OPEN, terminated.as_ptr(), mode, name.len()) };
        if handle == usize::MAX { Err(Refused) } else { Ok(Self(handle)) }
    }

    /// Fills the buffer from the file and returns true; returns false at the end of the file.
    ///
    /// # Errors
    /// The file ends within the buffer, or cannot be read.
    pub fn read(&mut self, buffer: &mut [u8]) -> Result<bool, Refused> {
        // SAFETY: SYS_READ writes at most `buffer.len()` bytes to `buffer`, which is mutably
        // borrowed until the call returns. The macro's argument block is a temporary that also
        // lives until then.
        let missing = unsafe { syscall!(READ, self.0, buffer.as_mut_ptr(), buffer.len()) };
        match missing {
            0 => Ok(true),
            missing if missing == buffer.len() => Ok(false),
            _ => Err(Refused),
        }
    }

    /// Appends all bytes to the file.
    ///
    /// # Errors
    /// The disk is full or the host reports another error.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), Refused> {
        // SAFETY: SYS_WRITE reads `bytes.len()` bytes from `bytes`, which is borrowed until the
        // call returns. The macro's argument block is a temporary that also lives until then.
        let missing = unsafe { syscall!(WRITE, self.0, bytes.as_ptr(), bytes.len()) };
        if missing == 0 { Ok(()) } else { Err(Refused) }
    }
}

/// Ends the emulation. The exit status of QEMU is 0 if `success` is true, otherwise 1.
pub fn exit(success: bool) -> ! {
    loop {
        debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    }
}
