//! Which interrupt does what, and how urgent it is.
#![expect(unsafe_code, reason = "the vector table, and what it points to")]

use cortex_m::peripheral::NVIC;
use embassy_executor::InterruptExecutor;
use firmware::deadlines::priority;

use crate::{application, drdy, time_driver, trigger, uart};

/// Interrupts of the MPS2 that are used; the spare ones run executors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub(crate) enum Interrupt {
    Uart0Receive = 0,
    Uart0Transmit = 1,
    Timer0 = 8,
    Timer1 = 9,
    DualTimer = 10,
    Encode = 29,
    Acquire = 30,
    Converse = 31,
}

// SAFETY: the numbers are those of the MPS2's interrupts, and stay what they are.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static CONVERSE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static ENCODE: InterruptExecutor = InterruptExecutor::new();

/// Gives every interrupt its priority; 3 bits of it, as in the emulated cores' 8, are its upper ones.
pub(crate) fn prioritise(nvic: &mut NVIC) {
    for (interrupt, level) in [
        (Interrupt::Timer1, priority::DRDY),
        (Interrupt::DualTimer, priority::DRDY),
        (Interrupt::Acquire, priority::ACQUIRE),
        (Interrupt::Timer0, priority::TIME),
        (Interrupt::Uart0Receive, priority::CONVERSE),
        (Interrupt::Uart0Transmit, priority::CONVERSE),
        (Interrupt::Converse, priority::CONVERSE),
        (Interrupt::Encode, priority::ENCODE),
    ] {
        // SAFETY: nothing runs yet that relies on another order.
        unsafe { nvic.set_priority(interrupt, level << 4) };
    }
    for interrupt in [
        Interrupt::Timer0,
        Interrupt::Timer1,
        Interrupt::DualTimer,
        Interrupt::Uart0Receive,
        Interrupt::Uart0Transmit,
    ] {
        // SAFETY: its handler is in the table, and no critical section is open.
        unsafe { NVIC::unmask(interrupt) };
    }
}

unsafe extern "C" fn acquire() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { ACQUIRE.on_interrupt() }
}

unsafe extern "C" fn converse() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { CONVERSE.on_interrupt() }
}

unsafe extern "C" fn encode() {
    // SAFETY: called by this executor's interrupt alone.
    unsafe { ENCODE.on_interrupt() }
}

unsafe extern "C" fn timer0() {
    time_driver::alarm();
}

unsafe extern "C" fn timer1() {
    drdy::edge();
}

unsafe extern "C" fn dual_timer() {
    if let Some((kind, at_us)) = trigger::edge() {
        application::SHARED.inputs.captured(kind, at_us);
    }
}

unsafe extern "C" fn uart0_receive() {
    uart::receive();
}

unsafe extern "C" fn uart0_transmit() {
    uart::transmit();
}

unsafe extern "C" {
    fn DefaultHandler();
}

/// The table behind the core's own vectors; cortex-m-rt's linker script places it.
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [unsafe extern "C" fn(); 32] = {
    let mut table: [unsafe extern "C" fn(); 32] = [DefaultHandler; 32];
    table[Interrupt::Uart0Receive as usize] = uart0_receive;
    table[Interrupt::Uart0Transmit as usize] = uart0_transmit;
    table[Interrupt::Timer0 as usize] = timer0;
    table[Interrupt::Timer1 as usize] = timer1;
    table[Interrupt::DualTimer as usize] = dual_timer;
    table[Interrupt::Encode as usize] = encode;
    table[Interrupt::Acquire as usize] = acquire;
    table[Interrupt::Converse as usize] = converse;
    table
};
