//! USB: a serial port of the communications device class (CDC-ACM) at full speed.

use device::Session;
use embassy_futures::{join::join, select::select};
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
use firmware::{Frames, HandedOut, Machine};
use static_cell::{ConstStaticCell, StaticCell};

use crate::{
    application::SHARED,
    usb_port::{Closed, FromHost, PACKET, Receiver, ToHost, Transmitter},
    usb_recovery::{DisableEndpoints, reset_overlooked},
};

/// Of pid.codes, for development only: whoever gives devices away needs a number of their own.
const VENDOR: u16 = 0x1209;
const PRODUCT: u16 = 0x0001;

const _: () = assert!(PACKET <= u16::MAX as usize);

/// Bytes of the binary device object store, which a device of USB 2.1 must have: its header, and the
/// extension for USB 2.0 (USB 3.2, 9.6.2 and 9.6.2.1). Without room embassy-usb sends an empty one.
const OBJECT_STORE: usize = 5 + 7;

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
        static STORE: ConstStaticCell<[u8; OBJECT_STORE]> = ConstStaticCell::new([0; OBJECT_STORE]);
        static CONTROL: ConstStaticCell<[u8; PACKET]> = ConstStaticCell::new([0; PACKET]);
        static ENDPOINTS: StaticCell<DisableEndpoints> = StaticCell::new();
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
            STORE.take(),
            // No Microsoft OS descriptors: Windows has a driver for the class.
            &mut [],
            CONTROL.take(),
        );
        builder.handler(ENDPOINTS.init(DisableEndpoints));
        let state = STATE.init(State::new());
        #[expect(clippy::cast_possible_truncation, reason = "asserted")]
        let class = CdcAcmClass::new(&mut builder, state, PACKET as u16);
        let (sender, receiver) = class.split();
        let port = firmware::Port {
            input: Receiver(receiver),
            output: Transmitter::new(sender),
        };
        let conversation = firmware::converse(port, session, None, share, &SHARED, machine);
        let mut device = builder.build();
        let run = async {
            loop {
                // It does not end by itself.
                select(device.run(), reset_overlooked()).await;
            }
        };
        join(run, conversation).await.0
    }
}

impl FromHost for cdc_acm::Receiver<'static, Driver<'static, USB_OTG_FS>> {
    async fn receive(&mut self, packet: &mut [u8]) -> Result<usize, Closed> {
        self.read_packet(packet).await.map_err(|_| Closed)
    }
}

impl ToHost for cdc_acm::Sender<'static, Driver<'static, USB_OTG_FS>> {
    fn is_open(&self) -> bool {
        self.dtr()
    }

    async fn set_up(&mut self) {
        self.wait_connection().await;
    }

    /// Given up while it waits, it has given nothing to the peripheral yet.
    async fn send(&mut self, packet: &[u8]) -> Result<(), Closed> {
        self.write_packet(packet).await.map_err(|_| Closed)
    }

    fn tick(&self) -> impl Future<Output = ()> + use<> {
        Timer::after(TICK)
    }
}
