//! Interrupt handlers, their priorities, the vector table, and the state that they share with
//! tasks.
#![expect(unsafe_code, reason = "the vector table and its handlers")]

use cortex_m::peripheral::NVIC;
use embassy_executor::InterruptExecutor;
use firmware::deadlines::priority;
use firmware::{Clock, Shared};

use crate::registers::CLOCK_HZ;
use crate::{drdy, time_driver, trigger, uart};

/// Interrupts of the MPS2 that the image uses. The last three, `Encode`, `Acquire` and `Converse`,
/// belong to no peripheral of the emulated boards and are therefore free to run the executors.
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

// SAFETY: the discriminants are the MPS2's interrupt numbers.
unsafe impl cortex_m::interrupt::InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static CONVERSE: InterruptExecutor = InterruptExecutor::new();
pub(crate) static ENCODE: InterruptExecutor = InterruptExecutor::new();

/// Sets the priorities and enables the interrupts. As on the NUCLEO boards, the upper 4 bits of a
/// priority hold the level.
pub(crate) fn init(nvic: &mut NVIC) {
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
        // SAFETY: no code that relies on the priorities runs yet.
        unsafe { nvic.set_priority(interrupt, level << 4) };
    }
    for interrupt in [
        Interrupt::Timer0,
        Interrupt::Timer1,
        Interrupt::DualTimer,
        Interrupt::Uart0Receive,
        Interrupt::Uart0Transmit,
    ] {
        // SAFETY: the vector table has a handler for the interrupt, and no critical section is
        // open.
        unsafe { NVIC::unmask(interrupt) };
    }
}

unsafe extern "C" fn acquire() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { ACQUIRE.on_interrupt() }
}

unsafe extern "C" fn converse() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { CONVERSE.on_interrupt() }
}

unsafe extern "C" fn encode() {
    // SAFETY: called only by the interrupt that belongs to this executor.
    unsafe { ENCODE.on_interrupt() }
}

unsafe extern "C" fn timer0() {
    time_driver::on_alarm();
}

unsafe extern "C" fn timer1() {
    drdy::on_edge();
}

unsafe extern "C" fn dual_timer() {
    if let Some((kind, at_us)) = trigger::take_edge() {
        SHARED.inputs.push_event(kind, at_us);
    }
}

unsafe extern "C" fn uart0_receive() {
    uart::on_receive();
}

unsafe extern "C" fn uart0_transmit() {
    uart::on_transmit();
}

unsafe extern "C" {
    fn DefaultHandler();
}

/// Interrupt vectors of the peripherals; cortex-m-rt's linker script places them after the core's
/// exception vectors.
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

/// Shared state of the tasks. The free-running timer measures the durations of the stages.
pub(crate) static SHARED: Shared = Shared::new(Clock { now: time_driver::ticks, hz: CLOCK_HZ });
