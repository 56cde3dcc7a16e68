//! UART5, the port to the host, on header J2.6.

use board_stm32::{Uart, stm32f4::uart};
use embassy_stm32::{interrupt::Interrupt, pac, peripherals};

/// UART5, whose pins lead to the header J2.6 (RM0090, USART).
pub(crate) struct Uart5;

impl Uart for Uart5 {
    type Instance = peripherals::UART5;

    const INTERRUPTS: [Interrupt; 3] =
        [Interrupt::UART5, Interrupt::DMA1_STREAM7, Interrupt::DMA1_STREAM0];

    fn data_register() -> *mut u8 {
        uart::data_register(pac::UART5)
    }

    fn enable_receiver() {
        uart::enable_receiver(pac::UART5);
    }

    fn acknowledge() {
        uart::acknowledge(pac::UART5);
    }
}
