//! The trigger: edges of an input, stamped by the timer that counts the device's time.
//!
//! The time driver counts microseconds with TIM2, in periods of 2^16, and uses its channels 1 and 2.
//! Channel 3 captures the counter at either edge (RM0433 and RM0390, TIM2, input capture mode), so
//! that a stamp is the device's time, to the microsecond, however late its interrupt comes. The driver
//! leaves the channel alone; it clears its flag, which nobody reads. TIM5 would do as well, if its spare
//! channels 3 and 4 were not the ST-LINK's UART on the NUCLEO-F446RE.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::{
    Peri,
    exti::{ExtiInput, TriggerEdge},
    gpio::Pull,
    interrupt::{self, InterruptExt},
    mode::Blocking,
    pac::{
        GPIOB, TIM2,
        gpio::vals::{Idr, Moder},
        timer::vals::CcmrInputCcs,
    },
    peripherals::{EXTI10, PB10},
};
use embassy_time::Instant;
use firmware::deadlines;
use link::EventKind;

use crate::{application::SHARED, interrupts, trigger_line::TriggerLine};

/// The trigger's input; a line that nobody drives is low.
pub struct Trigger {
    /// TIM2's channel 3.
    pub pin: Peri<'static, PB10>,
    /// The pin's own line.
    pub line: Peri<'static, EXTI10>,
}

/// Number of the pin in its port, and of its line.
const PIN: usize = 10;
/// Number of the channel, from 0.
const CHANNEL: usize = 2;
/// TIM2's function of the pin (DS12110 and DS10693, alternate functions).
const FUNCTION: u8 = 1;

static LINE: Mutex<RefCell<TriggerLine>> = Mutex::new(RefCell::new(TriggerLine::new()));

impl Trigger {
    /// Lets edges be captured; they are looked at when [`allow`] says so.
    pub(crate) fn begin(self) {
        let input: ExtiInput<'_, Blocking> =
            ExtiInput::new_blocking(self.pin, self.line, Pull::Down, TriggerEdge::Any);
        // Dropped, it would give the pin back.
        core::mem::forget(input);
        // The pin's line sees what the pin sees, whatever the pin is for (RM0433, GPIO, external
        // interrupt lines).
        GPIOB
            .afr(PIN / 8)
            .modify(|pins| pins.set_afr(PIN % 8, FUNCTION));
        GPIOB
            .moder()
            .modify(|pins| pins.set_moder(PIN, Moder::ALTERNATE));
        // Channel and pin of the same number; no filter, no prescaler.
        TIM2.ccmr_input(CHANNEL / 2)
            .modify(|channels| channels.set_ccs(CHANNEL % 2, CcmrInputCcs::from_bits(0b01)));
        // Both edges.
        TIM2.ccer().modify(|channels| {
            channels.set_ccp(CHANNEL, true);
            channels.set_ccnp(CHANNEL, true);
            channels.set_cce(CHANNEL, true);
        });
        critical_section::with(|section| {
            let mut line = LINE.borrow_ref_mut(section);
            line.begin(is_high(), stamp());
        });
    }
}

/// A sample is waited for: as many edges may come until then as there is room for.
pub(crate) fn allow() {
    let was_spent = critical_section::with(|section| {
        let mut line = LINE.borrow_ref_mut(section);
        line.allow(deadlines::TRIGGER_EDGES)
    });
    if was_spent {
        interrupts::listen_to_trigger();
    }
}

/// The line has an edge; called by its interrupt. After as many as are allowed it is called no more: the
/// timer goes on to capture, and the last edge is looked at when it may be. While no samples are taken,
/// its stamp is wrong by whole periods of 65.536 ms then; nothing streams.
pub(crate) fn edge() {
    interrupts::acknowledge(1 << PIN);
    let edge = critical_section::with(|section| {
        let mut line = LINE.borrow_ref_mut(section);
        // The level first: an edge after it comes again, as one of its own.
        let (is_high, stamp) = (is_high(), stamp());
        let edge = line.look(is_high, stamp, Instant::now().as_micros());
        if line.is_spent() {
            interrupt::EXTI15_10.disable();
        }
        edge
    });
    let Some(edge) = edge else { return };
    SHARED.inputs.lost(edge.lost);
    let kind = if edge.is_rise {
        EventKind::TriggerRise
    } else {
        EventKind::TriggerFall
    };
    SHARED.inputs.captured(kind, edge.at_us);
}

fn is_high() -> bool {
    GPIOB.idr().read().idr(PIN) == Idr::HIGH
}

/// The counter at the last edge.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the time driver's counter has 16 bits"
)]
fn stamp() -> u16 {
    TIM2.ccr(CHANNEL).read() as u16
}
