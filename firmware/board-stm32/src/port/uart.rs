//! Port over a UART, by DMA in both directions.
//!
//! The DMA stores received bytes in a ring. One interrupt per byte would be too slow: a byte lasts
//! 10.85 us, and the acquisition blocks the port's interrupts for longer. embassy-stm32 0.6.0 has
//! such a ring (`RingBufferedUartRx`), which is not suitable for two reasons. After a framing error
//! its DMA restarts at the start of the ring, and the reader receives old bytes again, even whole
//! commands. And on an STM32F4 each of its polls reads the data register, which can take a byte
//! from the DMA.
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
use firmware::{Frames, Machine, OutputReceiver, deadlines};

use crate::application::SHARED;
use crate::interrupts::nvic_priority;
use crate::port::uart_stream::{DmaTransmitter, Overrun, Ring, RingReceiver, Transmit};

/// Bit rate, bits per second. The line carries 92 kB/s, of which the codes need 3 %.
const BAUD: u32 = 921_600;

/// Size of the buffer of each direction, bytes. Received bytes fill the buffer in 5.5 ms, so the
/// reader can be late by this time without losing bytes.
const BUFFER: usize = 512;

/// Waker of the reader of received bytes. The UART's interrupt wakes the reader when the line
/// becomes idle after bytes and when a byte is damaged; on an STM32F4, also when the next byte
/// after one of these events arrives.
static IDLE: AtomicWaker = AtomicWaker::new();

/// Buffers of both directions, in memory that the DMA can access.
pub struct PortMemory {
    sending: [u8; BUFFER],
    received: [u8; BUFFER],
}

impl PortMemory {
    /// Buffers filled with zeros.
    pub const EMPTY: Self = Self { sending: [0; BUFFER], received: [0; BUFFER] };
}

/// Functions of a board's UART that differ from chip to chip.
pub trait Uart {
    /// UART peripheral, as a type of the HAL.
    type Instance: usart::Instance;

    /// Interrupts of the UART itself, of the DMA stream to the host, and of the DMA stream from the
    /// host.
    const INTERRUPTS: [Interrupt; 3];

    /// Returns the address of the receive data register.
    fn data_register() -> *mut u8;

    /// Enables the receiver, its DMA requests, and interrupts on an idle line and on damaged bytes.
    fn enable_receiver();

    /// Clears the flags of an idle line and of damaged bytes, or masks the interrupts of these
    /// flags until the next byte. Called by the UART's interrupt handler in a critical section,
    /// before the handler wakes the reader.
    fn acknowledge();
}

/// Interrupt handler of a board's [`Uart`]: acknowledges the interrupt and wakes the reader.
pub struct UartInterrupt<U>(PhantomData<U>);

impl<U: Uart> Handler<<U::Instance as usart::Instance>::Interrupt> for UartInterrupt<U> {
    unsafe fn on_interrupt() {
        critical_section::with(|_| U::acknowledge());
        IDLE.wake();
    }
}

/// Port to the host over a UART.
pub struct Port {
    input: RingReceiver<DmaRing>,
    output: DmaTransmitter<UartTx<'static, Async>>,
}

impl Port {
    /// Creates the port and starts reception into the ring, from which the conversation task reads.
    pub fn new<U: Uart, D: RxDma<U::Instance>>(
        sender: UartTx<'static, Async>,
        pin: Peri<'static, impl RxPin<U::Instance>>,
        stream: Peri<'static, D>,
        interrupts: impl Binding<D::Interrupt, dma::InterruptHandler<D>>
        + Binding<<U::Instance as usart::Instance>::Interrupt, UartInterrupt<U>>
        + 'static,
        memory: &'static mut PortMemory,
    ) -> Self {
        // embassy has given all DMA streams DRDY's priority; the port must be less urgent.
        for interrupt in U::INTERRUPTS {
            interrupt.set_priority(nvic_priority(deadlines::priority::CONVERSE));
        }
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        // The pull-up keeps the line idle while nothing drives it.
        pin.set_as_af_unchecked(function, AfType::input(Pull::Up));
        // Dropping `pin` would disconnect it from the UART.
        mem::forget(pin);
        let request = stream.request();
        let channel = Channel::new(stream, interrupts);
        // SAFETY: the pointer is the address of this UART's 8-bit data register, which always
        // exists. Nothing else uses `memory.received`, which is borrowed for `'static`.
        let mut ring = unsafe {
            ReadableRingBuffer::new(
                channel,
                request,
                U::data_register(),
                &mut memory.received,
                TransferOptions::default(),
            )
        };
        ring.start();
        U::enable_receiver();
        let [own, ..] = U::INTERRUPTS;
        // SAFETY: the UART's handler is bound (`interrupts`), and no critical section relies on the
        // UART's interrupt being disabled.
        unsafe { own.enable() };
        Self {
            input: RingReceiver(DmaRing(ring)),
            output: DmaTransmitter::new(sender, &mut memory.sending),
        }
    }

    /// Returns the configuration with which a board creates its UART: 921,600 baud, otherwise
    /// embassy's default.
    pub fn config() -> Config {
        let mut config = Config::default();
        config.baudrate = BAUD;
        config
    }

    pub(crate) async fn converse(
        self,
        session: &mut Session<'_>,
        memory: (&mut Frames, OutputReceiver),
        machine: Machine,
    ) -> ! {
        let Self { input, output } = self;
        let port = firmware::Port { input, output };
        firmware::converse(port, session, None, memory, &SHARED, machine).await
    }
}

/// Ring of received bytes that the DMA fills.
struct DmaRing(ReadableRingBuffer<'static, u8>);

impl Ring for DmaRing {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Overrun> {
        let taken = self.0.read(bytes);
        taken.map(|(length, _)| length).map_err(|_| Overrun)
    }

    /// Registers the waker for three events: the DMA reaches the middle or the end of the ring, or
    /// the line becomes idle.
    fn register_waker(&mut self, waker: &Waker) {
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
