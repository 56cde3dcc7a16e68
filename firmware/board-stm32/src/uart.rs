//! The UART of the board's debugger, by DMA in both directions.
//!
//! Reception is a DMA ring and not one interrupt per byte: a byte lasts 10.85 us, and the acquisition
//! blocks the port's interrupts for longer. embassy-stm32 0.6.0 has such a ring (`RingBufferedUartRx`),
//! which does not suit: after a framing error its DMA starts at the beginning of the ring again, and the
//! reader is handed old bytes, whole commands among them; and each of its polls on an STM32F4 reads the
//! data register, which may take a byte from the DMA.
#![expect(
    unsafe_code,
    reason = "a DMA without end into memory that the port owns, and its interrupt"
)]

use core::{marker::PhantomData, mem, task::Waker};

use device::Session;
use embassy_stm32::{
    Peri,
    dma::{self, Channel, ReadableRingBuffer, TransferOptions},
    gpio::{AfType, Flex, Pull},
    interrupt::{
        Interrupt, InterruptExt,
        typelevel::{Binding, Handler},
    },
    mode::Async,
    usart::{self, Config, RxDma, RxPin, UartTx},
};
use embassy_sync::waitqueue::AtomicWaker;
use firmware::{Frames, HandedOut, Machine, deadlines};

use crate::{
    application::SHARED,
    prioritise,
    uart_port::{Bounced, Overrun, Received, Ring, Transmit},
};

/// Bits per second: 92 kB/s, which codes need 3 % of.
const BAUD: u32 = 921_600;

/// Bytes of each direction's buffer: 5.5 ms of the line. The reader may be held up for as long.
const BUFFER: usize = 512;

/// Woken when the line becomes idle after bytes and when a byte is damaged; on an STM32F446 also by the
/// first byte after that.
static IDLE: AtomicWaker = AtomicWaker::new();

/// Memory of both directions, where the DMA can reach it.
pub struct PortMemory {
    sending: [u8; BUFFER],
    received: [u8; BUFFER],
}

impl PortMemory {
    /// Nothing sent, nothing received.
    pub const EMPTY: Self = Self {
        sending: [0; BUFFER],
        received: [0; BUFFER],
    };
}

/// A board's UART: its receiver's registers, which differ from chip to chip.
pub trait Uart {
    /// Which one it is.
    type Instance: usart::Instance;

    /// Its interrupts: its own, and those of the DMA streams to the host and from it.
    const INTERRUPTS: [Interrupt; 3];

    /// Address of the register that received bytes are read from.
    fn data() -> *mut u8;

    /// Enables receiver, DMA requests, and interrupts at an idle line and at damaged bytes.
    fn listen();

    /// Clears the flags of an idle line and of damaged bytes, or masks them until the next byte; called by
    /// the interrupt, in a critical section. The reader is woken after it.
    fn acknowledge();
}

/// The interrupt handler of a board's [`Uart`].
pub struct UartInterrupt<U>(PhantomData<U>);

impl<U: Uart> Handler<<U::Instance as usart::Instance>::Interrupt> for UartInterrupt<U> {
    unsafe fn on_interrupt() {
        critical_section::with(|_| U::acknowledge());
        IDLE.wake();
    }
}

/// The port to the host.
pub struct Port {
    input: Received<Stream>,
    output: Bounced<UartTx<'static, Async>>,
}

impl Port {
    /// Starts to receive; bytes wait in the ring until the conversation reads them.
    pub fn new<U: Uart, D: RxDma<U::Instance>>(
        sender: UartTx<'static, Async>,
        pin: Peri<'static, impl RxPin<U::Instance>>,
        stream: Peri<'static, D>,
        interrupts: impl Binding<D::Interrupt, dma::InterruptHandler<D>>
        + Binding<<U::Instance as usart::Instance>::Interrupt, UartInterrupt<U>>
        + 'static,
        memory: &'static mut PortMemory,
    ) -> Self {
        // The chip's start has set all DMA streams to DRDY's priority.
        for interrupt in U::INTERRUPTS {
            interrupt.set_priority(prioritise(deadlines::priority::CONVERSE));
        }
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        // Idle also while the debugger is off.
        pin.set_as_af_unchecked(function, AfType::input(Pull::Up));
        // Dropped, it would give the pin back.
        mem::forget(pin);
        let request = stream.request();
        let channel = Channel::new(stream, interrupts);
        // SAFETY: the register is this UART's and holds bytes; the ring's memory is its own for the whole run.
        let mut ring = unsafe {
            ReadableRingBuffer::new(
                channel,
                request,
                U::data(),
                &mut memory.received,
                TransferOptions::default(),
            )
        };
        ring.start();
        U::listen();
        let [own, ..] = U::INTERRUPTS;
        // SAFETY: its handler is bound, and no critical section relies on its silence.
        unsafe { own.enable() };
        Self {
            input: Received(Stream(ring)),
            output: Bounced::new(sender, &mut memory.sending),
        }
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
        let Self { input, output } = self;
        let port = firmware::Port { input, output };
        firmware::converse(port, session, None, share, &SHARED, machine).await
    }
}

/// The DMA's ring of received bytes.
struct Stream(ReadableRingBuffer<'static, u8>);

impl Ring for Stream {
    fn take(&mut self, bytes: &mut [u8]) -> Result<usize, Overrun> {
        let taken = self.0.read(bytes);
        taken.map(|(length, _)| length).map_err(|_| Overrun)
    }

    /// At half a ring, at its end, and when the line becomes idle.
    fn wake_with(&mut self, waker: &Waker) {
        self.0.set_waker(waker);
        IDLE.register(waker);
    }
}

impl Transmit for UartTx<'static, Async> {
    type Error = usart::Error;

    async fn transmit(&mut self, bytes: &[u8]) -> Result<(), usart::Error> {
        self.write(bytes).await
    }
}
