//! UART that the ST-LINK is connected to.

use board_stm32::{Uart, stm32f4::uart};
use embassy_stm32::{interrupt::Interrupt, pac, peripherals};

/// USART2, whose pins lead to the ST-LINK (RM0390, USART).
pub(crate) struct Usart2;

impl Uart for Usart2 {
    type Instance = peripherals::USART2;

    const INTERRUPTS: [Interrupt; 3] =
        [Interrupt::USART2, Interrupt::DMA1_STREAM6, Interrupt::DMA1_STREAM5];

    fn data_register() -> *mut u8 {
        uart::data_register(pac::USART2)
    }

    fn enable_receiver() {
        uart::enable_receiver(pac::USART2);
    }

    fn acknowledge() {
        uart::acknowledge(pac::USART2);
    }
}
