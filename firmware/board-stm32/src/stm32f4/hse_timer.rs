//! TIM11, which measures the clock at the HSE input before the clocks are configured.

use embassy_stm32::pac::timer::vals::CcmrInputCcs;
use embassy_stm32::pac::{RCC, TIM11};

use crate::clock_source::{HSE_DIVIDER, HseTimer};

/// TIM11, which captures its own count at edges of the divided HSE clock.
#[derive(Debug)]
pub struct Timer;

impl HseTimer for Timer {
    fn start(&mut self) {
        RCC.cfgr().modify(|clocks| clocks.set_rtcpre(HSE_DIVIDER));
        RCC.apb2enr().modify(|enable| enable.set_tim11en(true));
        // The clock of the timer starts with a delay; a read of the register waits until the clock
        // runs.
        let _ = RCC.apb2enr().read();
        // Input 1 is HSE / RTCPRE (RM0390 and RM0090, TIM11_OR).
        TIM11.or().write_value(0b10);
        TIM11.ccmr_input(0).modify(|channel| {
            channel.set_ccs(0, CcmrInputCcs::TI4);
            channel.set_icpsc(0, 3);
        });
        TIM11.ccer().modify(|channel| channel.set_cce(0, true));
        TIM11.cr1().modify(|control| control.set_cen(true));
    }

    fn capture(&mut self) -> Option<u16> {
        // Reading the count clears the flag.
        TIM11.sr().read().ccif(0).then(|| TIM11.ccr(0).read().ccr())
    }

    fn stop(&mut self) {
        RCC.apb2rstr().modify(|reset| reset.set_tim11rst(true));
        RCC.apb2rstr().modify(|reset| reset.set_tim11rst(false));
        RCC.apb2enr().modify(|enable| enable.set_tim11en(false));
        RCC.cfgr().modify(|clocks| clocks.set_rtcpre(0));
    }
}
