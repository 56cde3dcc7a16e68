//! Registers of the UART that the ST-LINK is connected to.

use board_stm32::Uart;
use embassy_stm32::{interrupt::Interrupt, pac, peripherals};

/// USART2, which is connected to the ST-LINK (RM0390, USART).
pub(crate) struct Usart2;

impl Uart for Usart2 {
    type Instance = peripherals::USART2;

    const INTERRUPTS: [Interrupt; 3] = [
        Interrupt::USART2,
        Interrupt::DMA1_STREAM6,
        Interrupt::DMA1_STREAM5,
    ];

    fn data_register() -> *mut u8 {
        pac::USART2.dr().as_ptr().cast()
    }

    fn enable_receiver() {
        pac::USART2.cr3().modify(|control| {
            control.set_dmar(true);
            control.set_eie(true);
        });
        pac::USART2.cr1().modify(|control| {
            control.set_idleie(true);
            control.set_re(true);
        });
    }

    /// Masks the flags until the next byte, whose interrupt (RXNEIE) unmasks them.
    ///
    /// IDLE, FE and NF are cleared by a read of SR followed by one of DR (RM0390, USART_SR). Only the DMA
    /// reads DR: a byte can arrive between the two reads, and a byte that the CPU reads is missing in the
    /// ring. So the CPU reads SR, and the DMA reads DR when it moves the next byte. If the DMA's read did not
    /// clear the flags, each byte would interrupt and wake the reader, which is slower but loses nothing.
    ///
    /// ORE means that a byte is lost already, and with RXNEIE it would interrupt continuously, so it is
    /// cleared at once.
    fn acknowledge() {
        let uart = pac::USART2;
        let status = uart.sr().read();
        // With a byte in DR, the DMA is about to read it, which clears the flags.
        let is_moved = !status.rxne();
        if status.ore() && is_moved {
            let _ = uart.dr().read();
        }
        let is_flagged = status.idle() || status.fe() || status.ne();
        let waits_for_byte = is_flagged && is_moved && !status.ore();
        uart.cr3()
            .modify(|control| control.set_eie(!waits_for_byte));
        uart.cr1().modify(|control| {
            control.set_idleie(!waits_for_byte);
            control.set_rxneie(waits_for_byte);
        });
    }
}
