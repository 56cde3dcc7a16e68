//! Wrapper of the emulator's core that records program counters, sets registers and reads memory
//! that only the core can access.
#![expect(unsafe_code, reason = "passes memory from the emulator to its core")]

use std::collections::VecDeque;
use std::mem::ManuallyDrop;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::{
    BitAlias, CoreBus, CoreSpec, DataModel, Error, Exit, HaltReason, HostCall, Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::core_bus::{Bus, Differences, forward};

/// Number of the newest program counters that are stored. Failed accesses are recorded until at
/// least this number of them is stored.
const KEPT: usize = 16;

/// Handle of the running core: returns what the core's wrapper has recorded, and takes register
/// changes and read requests, which the wrapper carries out before the next call of
/// [`Processor::run`]. All clones share one state.
#[derive(Clone, Debug, Default)]
pub(crate) struct Observer(Arc<Mutex<Observed>>);

#[derive(Debug, Default)]
struct Observed {
    /// Program counters after the last calls of [`Processor::run`], the newest last.
    program_counters: VecDeque<u64>,
    /// Registers to set before the next call of [`Processor::run`]: GDB's number of the register,
    /// and value.
    set: Vec<(usize, u32)>,
    /// Addresses of words to read before the next call of [`Processor::run`].
    wanted: Vec<u64>,
    /// Address and value of each word that was read.
    read: Vec<(u64, u32)>,
    /// Accesses to unmapped memory: address, and program counter if it is known.
    failed: Vec<(u64, Option<u64>)>,
}

impl Observer {
    fn state(&self) -> MutexGuard<'_, Observed> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the program counters after the last calls of [`Processor::run`], the newest last.
    pub(crate) fn recent_program_counters(&self) -> Vec<u64> {
        self.state().program_counters.iter().copied().collect()
    }

    /// Returns the first accesses to unmapped memory: address, and program counter if it is known.
    pub(crate) fn failed_accesses(&self) -> Vec<(u64, Option<u64>)> {
        self.state().failed.clone()
    }

    /// Sets registers before the core runs again: 0 to 12 are r0 to r12, 13 is sp, 14 is lr, 15 is
    /// pc.
    pub(crate) fn set_registers(&self, registers: &[(usize, u32)]) {
        self.state().set.extend(registers);
    }

    /// Requests the words at `addresses` in the core's private address space, for example of the
    /// NVIC. The words are read before the core runs again.
    pub(crate) fn request_words(&self, addresses: &[u64]) {
        let mut state = self.state();
        state.wanted = addresses.to_vec();
        state.read.clear();
    }

    /// Returns address and value of each word of the last [`Self::request_words`]; empty until the
    /// core has run again.
    pub(crate) fn words_read(&self) -> Vec<(u64, u32)> {
        self.state().read.clone()
    }
}

/// A core that no board uses at present. The next board with the same image reuses it, because it
/// contains the host code into which it has translated the image's instructions, and translating
/// takes longer than most tests.
#[derive(Debug)]
struct IdleCore {
    /// Name of the image whose instructions the core has translated.
    image: String,
    inner: Box<dyn Processor>,
    /// State of the core before it first ran.
    initial: Vec<u8>,
}

static IDLE: Mutex<Vec<IdleCore>> = Mutex::new(Vec::new());

/// Returns an idle core that has run `image`, in its initial state; `None` if there is none.
fn take_idle(image: &str) -> Option<IdleCore> {
    let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
    let index = idle.iter().position(|core| core.image == image)?;
    let mut core = idle.swap_remove(index);
    core.inner.take_reset_request();
    core.inner.load(&core.initial).ok()?;
    Some(core)
}

/// Wraps a core so that `observer` has access to it and its accesses are corrected for the
/// `differences`. If possible, takes an idle core that has run `image` before.
pub(crate) fn wrap_core(
    mut core: CoreSpec,
    image: &str,
    observer: &Observer,
    differences: Differences,
) -> CoreSpec {
    let (make, observer, image) = (core.processor, observer.clone(), image.to_owned());
    let differences = Arc::new(differences);
    core.processor = Arc::new(move |endian: Endian| {
        let (inner, initial) = if let Some(idle) = take_idle(&image) {
            (idle.inner, idle.initial)
        } else {
            let inner = make(endian)?;
            let initial = inner.save();
            (inner, initial)
        };
        Ok(Box::new(Core {
            inner: ManuallyDrop::new(inner),
            initial,
            image: image.clone(),
            has_run: false,
            observer: observer.clone(),
            differences: Arc::clone(&differences),
        }) as Box<dyn Processor>)
    });
    core
}

/// The emulator's core and the data of its wrapper.
#[derive(Debug)]
struct Core {
    inner: ManuallyDrop<Box<dyn Processor>>,
    initial: Vec<u8>,
    image: String,
    has_run: bool,
    observer: Observer,
    differences: Arc<Differences>,
}

impl Drop for Core {
    /// Stores the wrapped core for the next board that runs the image.
    fn drop(&mut self) {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push(IdleCore {
            image: std::mem::take(&mut self.image),
            // SAFETY: nothing uses `inner` again, because `self` is being dropped.
            inner: unsafe { ManuallyDrop::take(&mut self.inner) },
            initial: std::mem::take(&mut self.initial),
        });
    }
}

impl Core {
    fn prepare(&mut self, now: VirtualNanos) {
        let mut state = self.observer.state();
        for (number, value) in std::mem::take(&mut state.set) {
            self.inner.set_gdb_register(number, &value.to_le_bytes());
        }
        for address in std::mem::take(&mut state.wanted) {
            let value = self.inner.debugger_access(None, address, Width::W32, now);
            let value = value.and_then(|value| u32::try_from(value).ok());
            state.read.push((address, value.unwrap_or(0)));
        }
    }
}

impl Processor for Core {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        self.has_run = true;
        self.prepare(bus.time(self.inner.retired()));
        let mut failed = Vec::new();
        let mut bus = Bus { inner: bus, differences: &self.differences, failed: &mut failed };
        let ran = self.inner.run(budget, &mut bus);
        let mut state = self.observer.state();
        // Keep only the first failed accesses, which show the cause best.
        if state.failed.len() < KEPT {
            state.failed.extend(failed);
        }
        if state.program_counters.len() == KEPT {
            state.program_counters.pop_front();
        }
        state.program_counters.push_back(self.inner.pc());
        ran
    }

    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        // SAFETY: the caller meets the requirements of `Processor::map` for this wrapper, and the
        // arguments are passed on unchanged. The wrapper does not use `host` itself. The inner core
        // outlives this wrapper and thereby the mapped memory, but it does not run until the next
        // wrapper has mapped all addresses again: every run of an image has the same memories.
        unsafe { self.inner.map(start, length, host, writable) }
    }

    /// Ignores requests to discard translations before the core first runs. The emulator sends them
    /// when it loads the image, but an idle core's translations come from the same image.
    fn ask(&mut self, queued: Queued) {
        if self.has_run || !matches!(queued, Queued::Invalidate(..)) {
            self.inner.ask(queued);
        }
    }

    forward! {
        &self:
        fn retired() -> u64;
        fn maps(start: u64, length: u64) -> bool;
        fn page_size() -> u64;
        fn next_event() -> Option<VirtualNanos>;
        fn waiting() -> bool;
        fn pc() -> u64;
        fn gdb_register(number: usize) -> Option<Vec<u8>>;
        fn target_xml() -> &'static str;
        fn data_model() -> DataModel;
        fn byte_order(address: u64) -> Endian;
        fn save() -> Vec<u8>;
        fn bit_alias(address: u64, width: Width) -> Option<BitAlias>;
        fn own_ranges() -> Vec<Range<u64>>;
        fn host_call(read: &mut dyn FnMut(u64, Width) -> Option<u64>) -> Option<HostCall>;
        &mut self:
        fn boot(table: u64, read: &dyn Fn(u64, Width) -> Option<u64>);
        fn reset();
        fn take_reset_request() -> bool;
        fn on_event(now: VirtualNanos);
        fn add_breakpoint(address: u64) -> bool;
        fn remove_breakpoint(address: u64);
        fn pass_breakpoint(address: u64);
        fn attach_debugger(attached: bool);
        fn hold_interrupts(held: bool);
        fn set_gdb_register(number: usize, bytes: &[u8]) -> bool;
        fn debugger_access(write: Option<u64>, address: u64, width: Width, now: VirtualNanos) -> Option<u64>;
        fn take_debugger_trace() -> Vec<u8>;
        fn load(bytes: &[u8]) -> Result<(), Error>;
        fn monitor_command(command: &str) -> Option<String>;
        fn debugger_halted(why: HaltReason) -> bool;
        fn check_reads(every: bool);
        fn check_words(words: &[u64]);
        fn answer_host_call(answer: Option<u64>);
    }
}
