//! Settings of a chain: clock, rate, gain, input, lead-off detection, and the chips' wiring.

use crate::clock::Clock;

/// Settings of a chain, the same for all of its chips and channels.
///
/// While the channels convert their electrodes, the pin SRB1 connects one reference electrode to
/// the negative inputs of all channels. The bias amplifier of chip 0 drives the subject to
/// mid-supply and so reduces mains interference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Master clock of the chips.
    pub clock: Clock,
    /// Sample rate, as a divider of the master clock.
    pub rate: Rate,
    /// Gain of every channel's amplifier.
    pub gain: Gain,
    /// Signal that every channel converts.
    pub input: Input,
    /// True to detect disconnected electrodes: a direct current of 6 nA pulls a positive input
    /// above 95 % of the supply unless it can flow through a good contact. The current adds some
    /// noise.
    pub lead_off: bool,
    /// Connection of the chips' data outputs to MISO.
    pub wiring: Wiring,
    /// Means by which the driver resets, starts and stops the chips.
    pub control: Control,
    /// Number of channels, from the first on, whose positive inputs get the excitation from which
    /// the impedance of their electrodes is measured ([`ImpedanceMeter`](crate::ImpedanceMeter)); 0
    /// for none. The spare channels, which come last, get no current, because it would drive their
    /// open inputs to the rails. The excitation takes the place of the direct current of
    /// `lead_off`.
    #[cfg(any(test, feature = "impedance"))]
    pub excited: u8,
}

/// Connection of the chips' data outputs to MISO. For a single chip, both variants are equivalent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// DOUT of chip k + 1 is wired to DAISY_IN of chip k, and DOUT of chip 0 to MISO: one burst
    /// with all chips selected reads a sample. Resistors connect the other DOUTs to MISO for
    /// read-back.
    Daisy,
    /// Every DOUT is wired to MISO: each chip is selected and read alone, in its own burst.
    Cascaded,
}

/// Means by which the driver resets, starts and stops the chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Control {
    /// The pins START and RESET are wired to the microcontroller.
    Pins,
    /// The driver sends opcodes. The pin START is wired to ground and RESET to DVDD. Cascaded chips
    /// get an opcode one after the other and do not sample at the same time, so only a daisy chain
    /// or a single chip may use this variant.
    Commands,
}

impl Settings {
    /// Settings for EEG at 512 Hz with gain 24.
    pub const EEG: Self = Self::eeg(Clock::EEG, Rate::Div4096, Gain::X24);

    /// Returns settings for EEG: no lead-off detection, a daisy chain, START and RESET on pins.
    pub const fn eeg(clock: Clock, rate: Rate, gain: Gain) -> Self {
        Self {
            clock,
            rate,
            gain,
            input: Input::Electrodes,
            lead_off: false,
            wiring: Wiring::Daisy,
            control: Control::Pins,
            #[cfg(any(test, feature = "impedance"))]
            excited: 0,
        }
    }
}

impl Settings {
    #[cfg(any(test, feature = "impedance"))]
    pub(crate) const fn excited_channels(self) -> u8 {
        self.excited
    }

    /// Returns 0: without the feature `impedance` there is no field `excited`, which saves flash.
    #[cfg(not(any(test, feature = "impedance")))]
    #[expect(clippy::unused_self, reason = "the other variant reads it")]
    pub(crate) const fn excited_channels(self) -> u8 {
        0
    }
}

/// Internal reference voltage, in volts (data sheet section 7.5).
pub(crate) const VREF: f64 = 4.5;

/// Gain of a channel's programmable amplifier (CHnSET.GAINn, data sheet section 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gain {
    /// Gain 1: full scale is +-4.5 V.
    X1 = 0,
    /// Gain 2: full scale is +-2.25 V.
    X2 = 1,
    /// Gain 4: full scale is +-1.125 V.
    X4 = 2,
    /// Gain 6: full scale is +-750 mV.
    X6 = 3,
    /// Gain 8: full scale is +-562.5 mV.
    X8 = 4,
    /// Gain 12: full scale is +-375 mV.
    X12 = 5,
    /// Gain 24: full scale is +-187.5 mV, one count is 22.35 nV.
    X24 = 6,
}

impl Gain {
    /// Every gain, in ascending order.
    pub const ALL: [Self; 7] =
        [Self::X1, Self::X2, Self::X4, Self::X6, Self::X8, Self::X12, Self::X24];

    /// Returns the gain with this factor; `None` for a factor that the amplifier lacks.
    pub const fn of_factor(factor: u32) -> Option<Self> {
        let mut index = 0;
        while index < Self::ALL.len() {
            if Self::ALL[index].factor() as u32 == factor {
                return Some(Self::ALL[index]);
            }
            index += 1;
        }
        None
    }

    /// Returns the gain as a factor, 1 to 24.
    pub const fn factor(self) -> u8 {
        [1, 2, 4, 6, 8, 12, 24][self as usize]
    }

    /// Returns the voltage of one count, in microvolts at the input: `2 VREF / gain / 2^24` (data
    /// sheet section 9.5.1), with the internal reference.
    #[inline]
    pub const fn lsb_uv(self) -> f64 {
        VREF * 1e6 / (self.factor() as f64) / 8_388_608.0
    }
}

/// Signal at the inputs of the channels (CHnSET.MUXn, data sheet section 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// The channel's electrodes.
    Electrodes = 0,
    /// Both inputs at mid-supply, to measure the channel's offset and noise.
    Shorted = 1,
    /// Square wave from the chip's generator, with an amplitude of VREF / 2400 (1.875 mV). Half a
    /// period has 2^20 periods of the chip's clock (CONFIG2, data sheet section 9.6.1.3).
    TestSignal = 5,
}

/// Amplitude of the test signal, half of its peak-to-peak voltage: VREF / 2400, in microvolts.
pub(crate) const TEST_AMPLITUDE_UV: f64 = VREF * 1e6 / 2400.0;

/// Half a period of the test signal, in clock cycles: the signal has 1 Hz with [`Clock::EEG`].
pub(crate) const TEST_HALF_PERIOD: u32 = 1 << 20;

/// Sample rate, as a divider of the master clock (CONFIG1.DR, data sheet section 9.6.1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rate {
    /// Clock / 128: 16 kHz at 2.048 MHz.
    Div128 = 0,
    /// Clock / 256: 8 kHz at 2.048 MHz.
    Div256 = 1,
    /// Clock / 512: 4 kHz at 2.048 MHz.
    Div512 = 2,
    /// Clock / 1024: 2 kHz at 2.048 MHz.
    Div1024 = 3,
    /// Clock / 2048: 1 kHz at 2.048 MHz, 1024 Hz with [`Clock::EEG`].
    Div2048 = 4,
    /// Clock / 4096: 500 Hz at 2.048 MHz, 512 Hz with [`Clock::EEG`].
    Div4096 = 5,
    /// Clock / 8192: 250 Hz at 2.048 MHz, 256 Hz with [`Clock::EEG`].
    Div8192 = 6,
}

impl Rate {
    /// Every rate, fastest first.
    pub const ALL: [Self; 7] = [
        Self::Div128,
        Self::Div256,
        Self::Div512,
        Self::Div1024,
        Self::Div2048,
        Self::Div4096,
        Self::Div8192,
    ];

    /// Returns the clock and the divider for `hz` samples per second. An external clock of 2.048
    /// MHz gives 250, 500, 1000 .. 16000 Hz, and [`Clock::EEG`] gives 256, 512, 1024 .. 16384 Hz;
    /// `None` for any other rate.
    pub const fn of_hz(hz: u32) -> Option<(Clock, Self)> {
        let mut index = 0;
        while index < Self::ALL.len() {
            let rate = Self::ALL[index];
            if rate.millihertz(Clock::EEG) == hz * 1000 {
                return Some((Clock::EEG, rate));
            }
            if rate.millihertz(Clock::DECIMAL) == hz * 1000 {
                return Some((Clock::DECIMAL, rate));
            }
            index += 1;
        }
        None
    }

    /// Returns the divider for `hz` samples per second with [`Clock::INTERNAL`]: 250, 500, 1000 ..
    /// 16000 Hz; `None` for any other rate.
    pub const fn of_hz_internal(hz: u32) -> Option<(Clock, Self)> {
        match Self::of_hz(hz) {
            Some((clock, rate)) if clock.hz() == Clock::INTERNAL.hz() => {
                Some((Clock::INTERNAL, rate))
            }
            _ => None,
        }
    }

    /// Returns the clock cycles between two samples.
    pub const fn divider(self) -> u32 {
        128 << self as u32
    }

    /// Returns the clock cycles from START to the first DRDY, at which the data are settled. The
    /// formula was neither compared with the table in data sheet section 9.4.1 nor measured.
    pub const fn settling(self) -> u32 {
        4 * self.divider() + 9
    }

    /// Returns the sample rate in millihertz, rounded down.
    #[expect(clippy::cast_possible_truncation, reason = "at most 17.6e6")]
    pub const fn millihertz(self, clock: Clock) -> u32 {
        (clock.hz() as u64 * 1000 / self.divider() as u64) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gain_is_found_by_its_factor() {
        for gain in Gain::ALL {
            assert_eq!(Gain::of_factor(gain.factor().into()), Some(gain));
        }
        assert_eq!([0, 3, 7, 25, 257].map(Gain::of_factor), [None; 5]);
    }

    #[test]
    fn rates_match_the_data_sheet_and_a_quartz_for_512_hz() {
        let sheet = Rate::ALL.map(|rate| rate.millihertz(Clock::DECIMAL) / 1000);
        assert_eq!(sheet, [16_000, 8000, 4000, 2000, 1000, 500, 250]);
        assert_eq!(Rate::Div4096.millihertz(Clock::EEG), 512_000);
    }

    #[test]
    fn the_usual_rates_have_a_clock_and_a_divider() {
        for hz in [250, 256, 500, 512, 1000, 1024, 16_000, 16_384] {
            let (clock, rate) = Rate::of_hz(hz).expect("a usual rate");
            assert_eq!(rate.millihertz(clock), hz * 1000);
        }
        for hz in [0, 128, 160, 511, 600, 32_768] {
            assert_eq!(Rate::of_hz(hz), None, "{hz}");
        }
        let internal = Some((Clock::INTERNAL, Rate::Div8192));
        assert_eq!(Rate::of_hz_internal(250), internal);
        assert_eq!(Rate::of_hz_internal(256), None);
    }
}
