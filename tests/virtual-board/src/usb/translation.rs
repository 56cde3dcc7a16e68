//! Redirects data accesses of the emulated processor from one range of addresses to another.
//!
//! The emulator's register tables cover a peripheral's address block before a board can put a window
//! there. A processor whose accesses are redirected reaches a window at a free address instead, and the
//! program does not notice.

#![expect(
    unsafe_code,
    reason = "`Processor::map` is unsafe, and a processor around another one has to forward it"
)]

use std::ops::Range;
use std::sync::Arc;

use rigless::emulator::{
    Access, BitAlias, Checked, CoreBus, CoreSpec, DataModel, Error, Exit, HaltReason, HostCall,
    InterruptLine, Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

/// A range of addresses and where it is redirected to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Redirect {
    /// The addresses the program uses.
    pub from: Range<u64>,
    /// The address that stands for the first of them.
    pub to: u64,
}

/// Where `address` goes, by the first of `redirects` that holds it.
fn redirected(redirects: &[Redirect], address: u64) -> u64 {
    redirects
        .iter()
        .find(|redirect| redirect.from.contains(&address))
        .map_or(address, |redirect| {
            address - redirect.from.start + redirect.to
        })
}

/// Makes the processor of `core` use `redirects`.
pub fn redirect(core: &mut CoreSpec, redirects: Vec<Redirect>) {
    let construct = Arc::clone(&core.processor);
    let redirects: Arc<[Redirect]> = redirects.into();
    core.processor = Arc::new(move |endian| {
        Ok(Box::new(Redirected {
            inner: construct(endian)?,
            redirects: Arc::clone(&redirects),
        }))
    });
}

/// A processor whose accesses are redirected.
#[derive(Debug)]
struct Redirected {
    inner: Box<dyn Processor>,
    redirects: Arc<[Redirect]>,
}

/// The bus that the inner processor is lent.
struct RedirectedBus<'a> {
    inner: &'a mut dyn CoreBus,
    redirects: &'a [Redirect],
}

impl RedirectedBus<'_> {
    fn redirected(&self, mut access: Access) -> Access {
        access.address = redirected(self.redirects, access.address);
        access
    }
}

impl CoreBus for RedirectedBus<'_> {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        self.inner.access(self.redirected(access), from_code)
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.inner.time(instructions)
    }

    fn queued(&mut self) -> Vec<Queued> {
        self.inner.queued()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        self.inner.carry_on(instructions, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.inner.acknowledge(line, instructions)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.inner.read_checked(self.redirected(access), report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.inner.write_checked(self.redirected(access))
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.inner.stops_before(&self.redirected(*access))
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.inner.send_trace(bytes);
    }
}

impl Processor for Redirected {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let mut bus = RedirectedBus {
            inner: bus,
            redirects: &self.redirects,
        };
        self.inner.run(budget, &mut bus)
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
        // SAFETY: the caller's promise, which is for the processor that is forwarded to.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_addresses_of_the_range_are_redirected() {
        let redirects = [Redirect {
            from: 0x1000..0x2000,
            to: 0x9000,
        }];
        for (address, expected) in [
            (0xFFF, 0xFFF),
            (0x1000, 0x9000),
            (0x1FFC, 0x9FFC),
            (0x2000, 0x2000),
        ] {
            assert_eq!(redirected(&redirects, address), expected, "{address:#x}");
        }
    }
}
