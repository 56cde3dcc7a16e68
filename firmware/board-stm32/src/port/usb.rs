//! Port over USB: a serial port of the communications device class (CDC-ACM), at full speed.

use device::Session;
use embassy_futures::{join::join, select::select};
use embassy_stm32::{
    Peri, bind_interrupts,
    pac::{self, otg::Otg},
    peripherals::{PA11, PA12, USB_OTG_FS},
    uid,
    usb::{self, Driver},
};
use embassy_time::{Duration, Timer};
use embassy_usb::{
    Builder, Config, Handler,
    class::cdc_acm::{self, CdcAcmClass, State},
};
use firmware::{Frames, Machine, OutputReceiver};
use static_cell::{ConstStaticCell, StaticCell};

use crate::application::SHARED;
use crate::port::usb_stream::{
    Closed, PACKET, PacketReceiver, PacketSender, Receiver, Transmitter,
};

/// Vendor id of pid.codes. With [`PRODUCT`] it serves for development only; devices that are
/// distributed need a product id of their own.
const VENDOR: u16 = 0x1209;
/// Product id that pid.codes reserves for tests.
const PRODUCT: u16 = 0x0001;

const _: () = assert!(PACKET <= u16::MAX as usize);

/// Size in bytes of the binary device object store, which a USB 2.1 device must have: the header
/// and the USB 2.0 extension (USB 3.2, sections 9.6.2 and 9.6.2.1). With a smaller buffer,
/// embassy-usb sends an empty store.
const OBJECT_STORE: usize = 5 + 7;

/// Interval between two checks of whether the host still has the port open.
const TICK: Duration = Duration::from_millis(20);

bind_interrupts!(struct Irqs {
    OTG_FS => usb::InterruptHandler<USB_OTG_FS>;
});

/// USB peripheral and pins for the port to the host.
pub struct Port {
    /// USB peripheral, with its PHY for full speed.
    pub otg: Peri<'static, USB_OTG_FS>,
    /// Data line D+.
    pub dp: Peri<'static, PA12>,
    /// Data line D-.
    pub dm: Peri<'static, PA11>,
}

impl Port {
    pub(crate) async fn converse(
        self,
        session: &mut Session<'_>,
        memory: (&mut Frames, OutputReceiver),
        machine: Machine,
    ) -> ! {
        static RECEIVED: ConstStaticCell<[u8; 4 * PACKET]> = ConstStaticCell::new([0; 4 * PACKET]);
        static CONFIGURATION: ConstStaticCell<[u8; 128]> = ConstStaticCell::new([0; 128]);
        static STORE: ConstStaticCell<[u8; OBJECT_STORE]> = ConstStaticCell::new([0; OBJECT_STORE]);
        static CONTROL: ConstStaticCell<[u8; PACKET]> = ConstStaticCell::new([0; PACKET]);
        static ENDPOINTS: StaticCell<DisableEndpoints> = StaticCell::new();
        static STATE: StaticCell<State<'static>> = StaticCell::new();

        let mut config = usb::Config::default();
        // The NUCLEO boards are powered by their ST-LINK, whether or not VBUS is present at the USB
        // socket.
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
            // No Microsoft OS descriptors: Windows has a driver for CDC-ACM.
            &mut [],
            CONTROL.take(),
        );
        builder.handler(ENDPOINTS.init(DisableEndpoints));
        let state = STATE.init(State::new());
        #[expect(clippy::cast_possible_truncation, reason = "asserted")]
        let class = CdcAcmClass::new(&mut builder, state, PACKET as u16);
        let (sender, receiver) = class.split();
        let port = firmware::Port { input: Receiver(receiver), output: Transmitter::new(sender) };
        let conversation = firmware::converse(port, session, None, memory, &SHARED, machine);
        let mut device = builder.build();
        let run = async {
            loop {
                // `device.run()` never returns. When it has missed a bus reset, `select` drops it,
                // and the loop starts it again.
                select(device.run(), wait_missed_reset()).await;
            }
        };
        join(run, conversation).await.0
    }
}

impl PacketReceiver for cdc_acm::Receiver<'static, Driver<'static, USB_OTG_FS>> {
    async fn receive(&mut self, packet: &mut [u8]) -> Result<usize, Closed> {
        self.read_packet(packet).await.map_err(|_| Closed)
    }
}

impl PacketSender for cdc_acm::Sender<'static, Driver<'static, USB_OTG_FS>> {
    fn is_open(&self) -> bool {
        self.dtr()
    }

    async fn wait_configured(&mut self) {
        self.wait_connection().await;
    }

    /// Dropping this future while it waits sends nothing: no byte is in the peripheral yet.
    async fn send(&mut self, packet: &[u8]) -> Result<(), Closed> {
        self.write_packet(packet).await.map_err(|_| Closed)
    }

    fn tick(&self) -> impl Future<Output = ()> + use<> {
        Timer::after(TICK)
    }
}

/// Registers of the USB peripheral, which embassy's driver also uses.
const OTG: Otg = pac::USB_OTG_FS;
/// Number of IN endpoints in use: control, notifications, data.
const IN_ENDPOINTS: usize = 3;

/// Largest number of times that a flag is polled. The USB peripheral sets the flag within some
/// cycles of 48 MHz, so a few polls are enough.
const MAX_POLLS: usize = 1_000;

/// Period at which the flag of a bus reset is polled. The driver handles a bus reset at once,
/// unless it waits for the rest of a control transfer.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// Disables the IN endpoints when the host resets the bus; embassy-usb-synopsys-otg 0.3.3 does not.
///
/// If the host has not read an endpoint's packet, a bus reset leaves the endpoint enabled. The
/// driver then waits without a limit until the endpoint is disabled, so a device that was unplugged
/// while it streamed would never send again. Disabling an endpoint takes two steps: NAK, then
/// disable (RM0433 and RM0390, OTG, IN data transfers, IN endpoint disable).
#[derive(Debug)]
struct DisableEndpoints;

impl Handler for DisableEndpoints {
    fn reset(&mut self) {
        for endpoint in 0..IN_ENDPOINTS {
            let (control, interrupts) = (OTG.diepctl(endpoint), OTG.diepint(endpoint));
            if !control.read().epena() {
                continue;
            }
            control.modify(|control| control.set_snak(true));
            wait_for(|| interrupts.read().inepne());
            control.modify(|control| {
                control.set_snak(true);
                control.set_epdis(true);
            });
            wait_for(|| interrupts.read().epdisd());
            // Writing 1 clears the flag.
            interrupts.write(|interrupts| interrupts.set_epdisd(true));
        }
    }
}

fn wait_for(flag: impl Fn() -> bool) {
    // If the flag is not set within the limit, the driver waits for the endpoint, as it would
    // without this handler.
    let _ = (0..MAX_POLLS).any(|_| flag());
}

/// Waits until the driver has missed a reset of the bus.
///
/// If the cable is unplugged within a control transfer, the driver keeps waiting for the rest of
/// the transfer, and the reset by the next host stays pending. When this function returns, the
/// caller must restart the device.
async fn wait_missed_reset() {
    let mut was_pending = false;
    loop {
        Timer::after(POLL_PERIOD).await;
        let is_pending = OTG.gintsts().read().usbrst();
        if is_pending && was_pending {
            return;
        }
        was_pending = is_pending;
    }
}
