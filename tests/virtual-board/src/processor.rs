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

use crate::core_bus::{Bus, Differences};

/// Number of program counters that are kept. Once this number of failed accesses is known, no more are
/// recorded.
const KEPT: usize = 16;

/// Access to the running core: records its state, and queues changes to apply before the next call of
/// [`Processor::run`]. Clones share one state.
#[derive(Clone, Debug, Default)]
pub(crate) struct Observer(Arc<Mutex<Observed>>);

#[derive(Debug, Default)]
struct Observed {
    /// Program counter after each of the last calls of [`Processor::run`], the newest last.
    program_counters: VecDeque<u64>,
    /// Registers to set before the next call of [`Processor::run`]: GDB's register number and value.
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

    /// Sets registers before the core next runs: 0 to 12 are r0 to r12, 13 is sp, 14 is lr, 15 is pc.
    pub(crate) fn set_registers(&self, registers: &[(usize, u32)]) {
        self.state().set.extend(registers);
    }

    /// Requests words of the core's private address space, for example of the NVIC. They are read before
    /// the core next runs.
    pub(crate) fn request_words(&self, addresses: &[u64]) {
        let mut state = self.state();
        state.wanted = addresses.to_vec();
        state.read.clear();
    }

    /// Returns address and value of the words of the last [`Self::request_words`]; empty until they have
    /// been read.
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

/// The emulator's core, wrapped; every method but [`Processor::run`] only forwards its call.
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

    fn retired(&self) -> u64 {
        self.inner.retired()
    }

    fn ask(&mut self, queued: Queued) {
        self.inner.ask(queued);
    }

    fn maps(&self, start: u64, length: u64) -> bool {
        self.inner.maps(start, length)
    }

    fn page_size(&self) -> u64 {
        self.inner.page_size()
    }

    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        // SAFETY: the caller meets the requirements of `Processor::map` for this wrapper, and the arguments
        // are passed on unchanged. The wrapper does not use `host` itself, and it drops the inner core when
        // it is dropped.
        unsafe { self.inner.map(start, length, host, writable) }
    }

    fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>) {
        self.inner.boot(table, read);
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn take_reset_request(&mut self) -> bool {
        self.inner.take_reset_request()
    }

    fn next_event(&self) -> Option<VirtualNanos> {
        self.inner.next_event()
    }

    fn on_event(&mut self, now: VirtualNanos) {
        self.inner.on_event(now);
    }

    fn waiting(&self) -> bool {
        self.inner.waiting()
    }

    fn pc(&self) -> u64 {
        self.inner.pc()
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.inner.add_breakpoint(address)
    }

    fn remove_breakpoint(&mut self, address: u64) {
        self.inner.remove_breakpoint(address);
    }

    fn pass_breakpoint(&mut self, address: u64) {
        self.inner.pass_breakpoint(address);
    }

    fn attach_debugger(&mut self, attached: bool) {
        self.inner.attach_debugger(attached);
    }

    fn hold_interrupts(&mut self, held: bool) {
        self.inner.hold_interrupts(held);
    }

    fn gdb_register(&self, number: usize) -> Option<Vec<u8>> {
        self.inner.gdb_register(number)
    }

    fn set_gdb_register(&mut self, number: usize, bytes: &[u8]) -> bool {
        self.inner.set_gdb_register(number, bytes)
    }

    fn debugger_access(
        &mut self,
        write: Option<u64>,
        address: u64,
        width: Width,
        now: VirtualNanos,
    ) -> Option<u64> {
        self.inner.debugger_access(write, address, width, now)
    }

    fn take_debugger_trace(&mut self) -> Vec<u8> {
        self.inner.take_debugger_trace()
    }

    fn target_xml(&self) -> &'static str {
        self.inner.target_xml()
    }

    fn data_model(&self) -> DataModel {
        self.inner.data_model()
    }

    fn byte_order(&self, address: u64) -> Endian {
        self.inner.byte_order(address)
    }

    fn save(&self) -> Vec<u8> {
        self.inner.save()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.inner.load(bytes)
    }

    fn monitor_command(&mut self, command: &str) -> Option<String> {
        self.inner.monitor_command(command)
    }

    fn debugger_halted(&mut self, why: HaltReason) -> bool {
        self.inner.debugger_halted(why)
    }

    fn bit_alias(&self, address: u64, width: Width) -> Option<BitAlias> {
        self.inner.bit_alias(address, width)
    }

    fn own_ranges(&self) -> Vec<Range<u64>> {
        self.inner.own_ranges()
    }

    fn check_reads(&mut self, every: bool) {
        self.inner.check_reads(every);
    }

    fn check_words(&mut self, words: &[u64]) {
        self.inner.check_words(words);
    }

    fn host_call(&self, read: &mut dyn FnMut(u64, Width) -> Option<u64>) -> Option<HostCall> {
        self.inner.host_call(read)
    }

    fn answer_host_call(&mut self, answer: Option<u64>) {
        self.inner.answer_host_call(answer);
    }
}
