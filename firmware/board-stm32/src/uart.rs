//! The UART of the board's debugger.

use device::Session;
use embassy_stm32::{
    interrupt::{Interrupt, InterruptExt},
    usart::{BufferedUart, Config, ConfigError},
};
use firmware::{Frames, HandedOut, Machine, deadlines};
use static_cell::ConstStaticCell;

use crate::{application::SHARED, prioritise};

/// Bits per second: 92 kB/s, which codes need 3 % of.
const BAUD: u32 = 921_600;

/// The port to the host.
pub struct Port(BufferedUart<'static>);

impl Port {
    /// What a board makes of room for both directions: to the host, and from it; and the UART's
    /// interrupt.
    ///
    /// # Panics
    /// When the UART's clock has no divider for the baud rate.
    pub fn new(
        interrupt: Interrupt,
        make: impl FnOnce(
            &'static mut [u8],
            &'static mut [u8],
        ) -> Result<BufferedUart<'static>, ConfigError>,
    ) -> Self {
        static SENDING: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);
        static RECEIVED: ConstStaticCell<[u8; 256]> = ConstStaticCell::new([0; 256]);
        interrupt.set_priority(prioritise(deadlines::priority::CONVERSE));
        Self(make(SENDING.take(), RECEIVED.take()).expect("921600 baud"))
    }

    /// What a board makes its UART with.
    pub fn config() -> Config {
        let mut config = Config::default();
        config.baudrate = BAUD;
        config
    }

    pub(crate) async fn converse(
        self,
        session: &mut Session<'_>,
        share: (&mut Frames, HandedOut),
        machine: Machine,
    ) -> ! {
        let (output, input) = self.0.split();
        let port = firmware::Port { input, output };
        firmware::converse(port, session, None, share, &SHARED, machine).await
    }
}
