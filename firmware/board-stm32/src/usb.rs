//! USB: a serial port of the communications device class (CDC-ACM) at full speed.

use device::Session;
use embassy_futures::{
    join::join,
    select::{Either, select},
};
use embassy_stm32::{
    Peri, bind_interrupts,
    peripherals::{PA11, PA12, USB_OTG_FS},
    uid,
    usb::{self, Driver},
};
use embassy_time::{Duration, Timer};
use embassy_usb::{
    Builder, Config,
    class::cdc_acm::{self, CdcAcmClass, State},
};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use firmware::{Frames, HandedOut, Machine};
use static_cell::{ConstStaticCell, StaticCell};

use crate::application::SHARED;

/// Of pid.codes, for development only: whoever gives devices away needs a number of their own.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;

/// Bytes of a packet at full speed (USB 2.0, 5.8.3).
const PACKET: usize = 64;
const _: () = assert!(PACKET <= u16::MAX as usize);

/// How often a port that is closed is looked at.
const TICK: Duration = Duration::from_millis(20);

bind_interrupts!(struct Irqs {
    OTG_FS => usb::InterruptHandler<USB_OTG_FS>;
});

/// The port to the host.
pub struct Port {
    /// The peripheral.
    pub otg: Peri<'static, USB_OTG_FS>,
    /// Its data lines.
    pub dp: Peri<'static, PA12>,
    /// The other one.
    pub dm: Peri<'static, PA11>,
}

impl Port {
    pub(crate) async fn converse(
        self,
        session: &mut Session<'_>,
        share: (&mut Frames, HandedOut),
        machine: Machine,
    ) -> ! {
        static RECEIVED: ConstStaticCell<[u8; 4 * PACKET]> = ConstStaticCell::new([0; 4 * PACKET]);
        static CONFIGURATION: ConstStaticCell<[u8; 128]> = ConstStaticCell::new([0; 128]);
        static CONTROL: ConstStaticCell<[u8; PACKET]> = ConstStaticCell::new([0; PACKET]);
        static STATE: StaticCell<State<'static>> = StaticCell::new();

        let mut config = usb::Config::default();
        // Both boards are fed by their ST-LINK: VBUS says nothing about them.
        config.vbus_detection = false;
        let driver = Driver::new_fs(self.otg, Irqs, self.dp, self.dm, RECEIVED.take(), config);
        let mut config = Config::new(VENDOR, PRODUCT);
        config.manufacturer = Some("Corticode");
        config.product = Some("Corticode");
        config.serial_number = Some(uid::uid_hex());
        let mut builder = Builder::new(
            driver,
            config,
            CONFIGURATION.take(),
            &mut [],
            &mut [],
            CONTROL.take(),
        );
        let state = STATE.init(State::new());
        #[expect(clippy::cast_possible_truncation, reason = "asserted")]
        let class = CdcAcmClass::new(&mut builder, state, PACKET as u16);
        let (sender, receiver) = class.split();
        let port = firmware::Port {
            input: Receiver(receiver),
            output: Transmitter {
                sender,
                last_was_full: false,
            },
        };
        let conversation = firmware::converse(port, session, None, share, &SHARED, machine);
        join(builder.build().run(), conversation).await.0
    }
}

/// The host is not there, or has closed the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Closed;

impl core::fmt::Display for Closed {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str("the host has closed the port")
    }
}

impl core::error::Error for Closed {}

impl embedded_io_async::Error for Closed {
    fn kind(&self) -> ErrorKind {
        ErrorKind::NotConnected
    }
}

struct Receiver(cdc_acm::Receiver<'static, Driver<'static, USB_OTG_FS>>);

impl ErrorType for Receiver {
    type Error = Closed;
}

impl Read for Receiver {
    /// `bytes` has room for a packet.
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Closed> {
        loop {
            match self.0.read_packet(bytes).await {
                // A packet of no length says no more than that there is no more.
                Ok(0) => {}
                Ok(length) => return Ok(length),
                Err(_) => return Err(Closed),
            }
        }
    }
}

/// Sends while the host holds the port open (DTR): what it does not read waits as frames, of which the
/// oldest are dropped.
struct Transmitter {
    sender: cdc_acm::Sender<'static, Driver<'static, USB_OTG_FS>>,
    /// A full packet was the last: the host's driver waits for more until a shorter one ends it.
    last_was_full: bool,
}

impl Transmitter {
    async fn opened(&mut self) {
        self.sender.wait_connection().await;
        while !self.sender.dtr() {
            Timer::after(TICK).await;
        }
    }

    /// Sends a packet, unless the port closes before the host takes it.
    async fn packet(&mut self, bytes: &[u8]) -> Result<(), Closed> {
        loop {
            // Looks at DTR again and again while the host takes nothing.
            match select(self.sender.write_packet(bytes), Timer::after(TICK)).await {
                Either::First(Ok(())) => return Ok(()),
                Either::First(Err(_)) => return Err(Closed),
                Either::Second(()) if !self.sender.dtr() => return Err(Closed),
                Either::Second(()) => {}
            }
        }
    }
}

impl ErrorType for Transmitter {
    type Error = Closed;
}

impl Write for Transmitter {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Closed> {
        if !self.sender.dtr() {
            self.opened().await;
        }
        let length = bytes.len().min(PACKET);
        self.packet(&bytes[..length]).await?;
        self.last_was_full = length == PACKET;
        Ok(length)
    }

    async fn flush(&mut self) -> Result<(), Closed> {
        if core::mem::take(&mut self.last_was_full) && self.sender.dtr() {
            self.packet(&[]).await?;
        }
        Ok(())
    }
}
