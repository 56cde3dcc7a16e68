//! Wrapper of the emulated core that records program counters and accesses registers and private
//! memory.
#![expect(unsafe_code, reason = "passes memory from the emulator to its core")]

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::{
    BitAlias, CoreBus, CoreSpec, DataModel, Error, Exit, HaltReason, HostCall, Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use crate::core_bus::{Bus, Differences, forward};

/// Number of program counters that are kept. Once this number of failed accesses is known, no more
/// are recorded.
const KEPT: usize = 16;

/// Access to the running core: records its state, and queues changes to apply before the next call
/// of [`Processor::run`]. Clones share one state.
#[derive(Clone, Debug, Default)]
pub(crate) struct Observer(Arc<Mutex<Observed>>);

#[derive(Debug, Default)]
struct Observed {
    /// Program counter after each of the last calls of [`Processor::run`], the newest last.
    program_counters: VecDeque<u64>,
    /// Registers to set before the next call of [`Processor::run`]: GDB's register number and
    /// value.
    set: Vec<(usize, u32)>,
    /// Addresses to read before the next call of [`Processor::run`].
    wanted: Vec<u64>,
    /// Addresses that were read, with the words found there.
    read: Vec<(u64, u32)>,
    /// Accesses to unmapped memory: address, and program counter if known.
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

    /// Returns the first accesses to unmapped memory: address, and program counter if known.
    pub(crate) fn failed_accesses(&self) -> Vec<(u64, Option<u64>)> {
        self.state().failed.clone()
    }

    /// Sets registers before the core next runs: 0 to 12 are r0 to r12, 13 is sp, 14 is lr, 15 is
    /// pc.
    pub(crate) fn set_registers(&self, registers: &[(usize, u32)]) {
        self.state().set.extend(registers);
    }

    /// Requests words of the core's private address space, for example of the NVIC. They are read
    /// before the core next runs.
    pub(crate) fn request_words(&self, addresses: &[u64]) {
        let mut state = self.state();
        state.wanted = addresses.to_vec();
        state.read.clear();
    }

    /// Returns address and value of the words of the last [`Self::request_words`]; empty until they
    /// have been read.
    pub(crate) fn words_read(&self) -> Vec<(u64, u32)> {
        self.state().read.clone()
    }
}

/// Wraps a core so that `observer` has access to it and `differences` apply to its accesses.
pub(crate) fn wrap_core(
    mut core: CoreSpec,
    observer: &Observer,
    differences: Differences,
) -> CoreSpec {
    let (make, observer) = (core.processor, observer.clone());
    let differences = Arc::new(differences);
    core.processor = Arc::new(move |endian: Endian| {
        Ok(Box::new(Core {
            inner: make(endian)?,
            observer: observer.clone(),
            differences: Arc::clone(&differences),
        }) as Box<dyn Processor>)
    });
    core
}

/// The emulator's core, wrapped.
#[derive(Debug)]
struct Core {
    inner: Box<dyn Processor>,
    observer: Observer,
    differences: Arc<Differences>,
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
        self.prepare(bus.time(self.inner.retired()));
        let mut failed = Vec::new();
        let mut bus = Bus {
            inner: bus,
            differences: &self.differences,
            failed: &mut failed,
        };
        let ran = self.inner.run(budget, &mut bus);
        let mut state = self.observer.state();
        // Later failed accesses are dropped: the first ones show the cause best.
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
        // arguments are passed on unchanged. The wrapper does not use `host` itself, and it drops
        // the inner core when it is dropped.
        unsafe { self.inner.map(start, length, host, writable) }
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
        fn ask(queued: Queued);
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
