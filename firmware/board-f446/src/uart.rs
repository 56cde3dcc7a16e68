//! The UART of the ST-LINK.

use board_stm32::Uart;
use embassy_stm32::{interrupt::Interrupt, pac, peripherals};

/// USART2.
pub(crate) struct Usart2;

impl Uart for Usart2 {
    type Instance = peripherals::USART2;

    const INTERRUPTS: [Interrupt; 3] = [
        Interrupt::USART2,
        Interrupt::DMA1_STREAM6,
        Interrupt::DMA1_STREAM5,
    ];

    fn data() -> *mut u8 {
        pac::USART2.dr().as_ptr().cast()
    }

    fn listen() {
        pac::USART2.cr3().modify(|control| {
            control.set_dmar(true);
            control.set_eie(true);
        });
        pac::USART2.cr1().modify(|control| {
            control.set_idleie(true);
            control.set_re(true);
        });
    }

    /// A read of SR and then one of DR clears the flags (RM0390, USART_SR). While a byte waits in DR,
    /// the DMA's read is the second one: the byte is the DMA's.
    fn acknowledge() {
        if !pac::USART2.sr().read().rxne() {
            let _ = pac::USART2.dr().read();
        }
    }
}
