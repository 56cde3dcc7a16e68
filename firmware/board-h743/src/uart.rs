//! Registers of the UART that the ST-LINK is connected to.

use board_stm32::Uart;
use embassy_stm32::{interrupt::Interrupt, pac, peripherals};

/// USART3, whose pins lead to the ST-LINK (RM0433, USART).
pub(crate) struct Usart3;

impl Uart for Usart3 {
    type Instance = peripherals::USART3;

    const INTERRUPTS: [Interrupt; 3] =
        [Interrupt::USART3, Interrupt::DMA1_STREAM2, Interrupt::DMA1_STREAM3];

    fn data_register() -> *mut u8 {
        pac::USART3.rdr().as_ptr().cast()
    }

    fn enable_receiver() {
        pac::USART3.cr3().modify(|control| {
            control.set_dmar(true);
            control.set_eie(true);
        });
        pac::USART3.cr1().modify(|control| {
            control.set_idleie(true);
            control.set_re(true);
        });
    }

    fn acknowledge() {
        pac::USART3.icr().write(|clear| {
            clear.set_idle(true);
            clear.set_ore(true);
            clear.set_ne(true);
            clear.set_fe(true);
        });
    }
}
