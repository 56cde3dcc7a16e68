//! Inspection of the chip's registers and memory while virtual time is stopped.

use rigless::mcu::Operate;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::findings::BoardError;
use crate::machine::VirtualBoard;

/// Word with which the start-up code (cortex-m-rt) fills the stack.
const PAINT: u64 = 0xCCCC_CCCC;

/// Addresses of the NVIC's first set-enable register and of its first priority register (ARM DDI
/// 0403, B3.4.3).
const ISER: u64 = 0xE000_E100;
const IPR: u64 = 0xE000_E400;

/// Number of interrupt lines that are inspected, a multiple of 32; the STM32H743 has 150 lines.
const LINES: u16 = 160;

/// Number of streams in a DMA controller, and distance in bytes between the registers of two
/// streams (RM0433, 15.5; RM0390, 9.5).
const STREAMS: u64 = 8;
const STREAM_BYTES: u64 = 0x18;
/// Offsets of stream 0's registers SxNDTR, SxPAR and SxM0AR in a DMA controller.
const LEFT: u64 = 0x10 + 0x04;
const PERIPHERAL: u64 = 0x10 + 0x08;
const MEMORY: u64 = 0x10 + 0x0C;

impl VirtualBoard {
    /// Returns the frequency in Hz of the core clock that the firmware has configured.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn core_hz(&mut self) -> Result<u64, BoardError> {
        self.inspect(|session, _| session.board().chip.core_hz())
    }

    /// Returns whether the core is running the code that replaces the boot loader.
    pub fn is_in_loader(&self) -> bool {
        let vectors = u64::from(self.model().facts().loader_vectors);
        let last = self.observer().recent_program_counters().pop();
        last.is_some_and(|place| (vectors..vectors + 16).contains(&place))
    }

    /// Returns the largest number of stack bytes in use since the last power-on or reset: the
    /// distance from the lowest overwritten word up to the stack's start.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn stack_used(&mut self) -> Result<u64, BoardError> {
        let [end, start] = ["_stack_end", "_stack_start"].map(|name| self.image().address(name));
        let (end, start) = (end.unwrap_or(0), start.unwrap_or(0));
        self.inspect(move |_, host| {
            let words = (end..start).step_by(4);
            let untouched = words
                .take_while(|&word| host.read(word, Width::W32).is_ok_and(|word| word == PAINT));
            start - end - 4 * untouched.count() as u64
        })
    }

    /// Returns whether the HSE oscillator is bypassed (RCC_CR, HSEBYP), as it must be for an
    /// external clock but not for a crystal.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn hse_is_bypassed(&mut self) -> Result<bool, BoardError> {
        let now = VirtualNanos(self.now_us() * 1000);
        self.inspect(move |session, _| {
            let (address, ready) = session.board().chip.hse_ready_flag();
            let control = session.mcu().peek(now, address, Width::W32).unwrap_or(0);
            // HSEBYP is the bit above HSERDY on all chips.
            control & ready << 1 != 0
        })
    }

    /// Returns the speed of the SPI's outputs SCLK and MOSI (OSPEEDR, 0 is the slowest), and the
    /// pulls of MISO, DRDY and trigger (PUPDR, 0 none, 1 up, 2 down).
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn pin_settings(&mut self) -> Result<([u64; 2], [u64; 3]), BoardError> {
        let pins = &self.model().facts().pins;
        self.inspect(|session, _| {
            let chip = &session.board().chip;
            let of = |pin| chip.speed_and_pull(pin).unwrap_or((u64::MAX, u64::MAX));
            (
                [pins.sclk, pins.mosi].map(|pin| of(pin).0),
                [pins.miso, pins.drdy, pins.trigger].map(|pin| of(pin).1),
            )
        })
    }

    /// Returns the line number and the priority of each enabled interrupt; priority 0 is the most
    /// urgent of 16.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn interrupts(&mut self) -> Result<Vec<(u16, u8)>, BoardError> {
        let words = u64::from(LINES / 32);
        let enables = (0..words).map(|word| ISER + 4 * word);
        let priorities = (0..u64::from(LINES / 4)).map(|word| IPR + 4 * word);
        let wanted: Vec<u64> = enables.chain(priorities).collect();
        self.observer().request_words(&wanted);
        self.run_for_us(1_000)?;
        let read = self.observer().words_read();
        let byte = |address: u64| {
            let word = read.iter().find(|(at, _)| *at == address & !3);
            word.map_or(0, |(_, word)| word.to_le_bytes()[(address & 3) as usize])
        };
        let is_enabled = |line: &u16| byte(ISER + u64::from(line / 8)) >> (line % 8) & 1 != 0;
        let lines = (0..LINES).filter(is_enabled);
        Ok(lines.map(|line| (line, byte(IPR + u64::from(line)) >> 4)).collect())
    }

    /// Returns the memory address and the number of items left to transfer (NDTR, 0 between
    /// transfers) of each stream of DMA1 that has a peripheral address.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn dma_memory(&mut self) -> Result<Vec<(u64, u64)>, BoardError> {
        let dma = self.model().facts().dma;
        let now = VirtualNanos(self.now_us() * 1000);
        self.inspect(move |session, _| {
            let mcu = session.mcu();
            let mut read = |address| mcu.peek(now, address, Width::W32).unwrap_or(0);
            let streams = (0..STREAMS).map(|stream| dma + stream * STREAM_BYTES);
            let used = streams.filter(|stream| read(stream + PERIPHERAL) != 0);
            let used: Vec<u64> = used.collect();
            used.into_iter().map(|stream| (read(stream + MEMORY), read(stream + LEFT))).collect()
        })
    }
}
