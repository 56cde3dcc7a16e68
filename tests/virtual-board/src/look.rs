//! Looks at the chip while time stands still.

use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::diagnosis::Trouble;
use crate::loader_stub;
use crate::machine::VirtualBoard;

/// What cortex-m-rt fills the stack with.
const PAINT: u64 = 0xCCCC_CCCC;

/// Set-enable and priority registers of the NVIC (ARM DDI 0403, B3.4.3).
const ISER: u64 = 0xE000_E100;
const IPR: u64 = 0xE000_E400;

/// Interrupt lines that are looked at.
const LINES: u16 = 160;

/// Streams of a DMA controller, and the distance of their registers (RM0433, 15.5; RM0390, 9.5).
const STREAMS: u64 = 8;
const STREAM_BYTES: u64 = 0x18;
/// Bytes left, peripheral's and memory's address of a stream, after its first register at 0x10.
const LEFT: u64 = 0x10 + 0x04;
const PERIPHERAL: u64 = 0x10 + 0x08;
const MEMORY: u64 = 0x10 + 0x0C;

impl VirtualBoard {
    /// The core clock that the firmware has set, Hz.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn core_hz(&mut self) -> Result<u64, Trouble> {
        self.inspect(|session, _| session.board().chip.core_hz())
    }

    /// Whether the core runs the chip's own loader, or what stands in for it here.
    pub fn is_in_loader(&self) -> bool {
        let vectors = u64::from(loader_stub::vectors(self.model()));
        let last = self.observer().trail().pop();
        last.is_some_and(|place| (vectors..vectors + 16).contains(&place))
    }

    /// Deepest use of the stack since power on or reset, bytes: what is above the lowest word that has
    /// been written.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn stack_used(&mut self) -> Result<u64, Trouble> {
        let [end, start] = ["_stack_end", "_stack_start"].map(|name| self.image().address(name));
        let (end, start) = (end.unwrap_or(0), start.unwrap_or(0));
        self.inspect(move |_, host| {
            let words = (end..start).step_by(4);
            let untouched = words
                .take_while(|&word| host.read(word, Width::W32).is_ok_and(|word| word == PAINT));
            start - end - 4 * untouched.count() as u64
        })
    }

    /// Interrupts that are enabled: line and priority, 0 the most urgent of 16.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn interrupts(&mut self) -> Result<Vec<(u16, u8)>, Trouble> {
        let words = u64::from(LINES / 32);
        let enables = (0..words).map(|word| ISER + 4 * word);
        let priorities = (0..u64::from(LINES / 4)).map(|word| IPR + 4 * word);
        let wanted: Vec<u64> = enables.chain(priorities).collect();
        self.observer().want(&wanted);
        self.run_for_us(1_000)?;
        let read = self.observer().read();
        let byte = |address: u64| {
            let word = read.iter().find(|(at, _)| *at == address & !3);
            word.map_or(0, |(_, word)| word.to_le_bytes()[(address & 3) as usize])
        };
        let is_enabled = |line: &u16| byte(ISER + u64::from(line / 8)) >> (line % 8) & 1 != 0;
        let lines = (0..LINES).filter(is_enabled);
        Ok(lines
            .map(|line| (line, byte(IPR + u64::from(line)) >> 4))
            .collect())
    }

    /// Memory of DMA1's streams that have a peripheral: first address, and the bytes that are left of the
    /// transfer, 0 between two of them.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn dma_memory(&mut self) -> Result<Vec<(u64, u64)>, Trouble> {
        let dma = self.model().dma();
        let now = VirtualNanos(self.now_us() * 1000);
        self.inspect(move |session, _| {
            let mcu = session.mcu();
            let mut read = |address| mcu.peek(now, address, Width::W32).unwrap_or(0);
            let streams = (0..STREAMS).map(|stream| dma + stream * STREAM_BYTES);
            let used = streams.filter(|stream| read(stream + PERIPHERAL) != 0);
            let used: Vec<u64> = used.collect();
            used.into_iter()
                .map(|stream| (read(stream + MEMORY), read(stream + LEFT)))
                .collect()
        })
    }
}
