//! Settings of the ADS1299s in a daisy chain: rate, gain, input, test signal, lead-off detection,
//! bias.

use crate::clock::Clock;
use crate::decoder::CHANNELS;

/// Settings of a chain: the chips' registers as typed fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings<const CHIPS: usize> {
    /// Master clock of all chips.
    pub clock: Clock,
    /// Sample rate of all chips.
    pub rate: Rate,
    /// Test signal of all chips, for channels at [`Input::TestSignal`].
    pub test_signal: TestSignal,
    /// Lead-off detection of all chips.
    pub lead_off: LeadOff,
    /// Settings per chip; chip 0 is wired to MISO.
    pub chips: [ChipSettings; CHIPS],
}

/// Settings of one chip. In a byte with one bit per channel, bit n is channel n, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipSettings {
    /// Settings per channel.
    pub channels: [Channel; CHANNELS],
    /// Settings of the bias amplifier.
    pub bias: Bias,
    /// Connects SRB1 to every negative input, so that one electrode is the reference of all
    /// channels (MISC1.SRB1, data sheet section 9.6.1.15).
    pub srb1: bool,
    /// Positive inputs with lead-off current, one bit each.
    pub lead_off_positive: u8,
    /// Negative inputs with lead-off current, one bit each.
    pub lead_off_negative: u8,
    /// Channels with reversed lead-off current, one bit each.
    pub lead_off_flip: u8,
}

/// Settings of one channel (CHnSET, data sheet section 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Powers the channel. A channel that is off reads 0; its input should be [`Input::Shorted`].
    pub on: bool,
    /// Gain of the amplifier.
    pub gain: Gain,
    /// Connects the positive input to SRB2.
    pub srb2: bool,
    /// Signal that the channel converts.
    pub input: Input,
}

/// Settings of a chip's bias amplifier, which drives the subject to mid-supply and so reduces mains
/// interference (data sheet section 9.3.2.4.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bias {
    /// Powers the amplifier.
    pub on: bool,
    /// Uses the chip's internal mid-supply voltage as the amplifier's reference
    /// (CONFIG3.BIASREF_INT).
    pub internal_reference: bool,
    /// Detects a disconnected bias electrode (CONFIG3.BIAS_LOFF_SENS).
    pub lead_off: bool,
    /// Positive inputs that the bias is derived from, one bit each.
    pub positive: u8,
    /// Negative inputs that the bias is derived from, one bit each.
    pub negative: u8,
}

impl Bias {
    /// Amplifier without power or inputs.
    pub const OFF: Self = Self {
        on: false,
        internal_reference: false,
        lead_off: false,
        positive: 0,
        negative: 0,
    };
}

impl<const CHIPS: usize> Settings<CHIPS> {
    /// Settings for EEG as [`eeg`](Self::eeg) returns them, at 512 Hz with gain 24.
    pub const EEG: Self = Self::eeg(Clock::EEG, Rate::Div4096, Gain::X24);

    /// Returns settings for EEG against one reference electrode at SRB1, with the bias driven by
    /// chip 0 from its positive inputs. No lead-off current, because it adds noise.
    pub const fn eeg(clock: Clock, rate: Rate, gain: Gain) -> Self {
        let chip = ChipSettings {
            channels: [Channel {
                on: true,
                gain,
                srb2: false,
                input: Input::Electrodes,
            }; CHANNELS],
            bias: Bias::OFF,
            srb1: true,
            lead_off_positive: 0,
            lead_off_negative: 0,
            lead_off_flip: 0,
        };
        let mut chips = [chip; CHIPS];
        chips[0].bias = Bias {
            on: true,
            internal_reference: true,
            positive: 0xFF,
            ..Bias::OFF
        };
        Self {
            clock,
            rate,
            test_signal: TestSignal::OFF,
            lead_off: LeadOff::OFF,
            chips,
        }
    }

    /// Returns these settings with every channel on and at `input`, for the self-test; the test
    /// signal is [`TestSignal::SELF_TEST`]. The electrodes have no effect: SRB1 is open, no
    /// lead-off current flows.
    #[must_use]
    pub fn with_input(mut self, input: Input) -> Self {
        self.test_signal = TestSignal::SELF_TEST;
        for chip in &mut self.chips {
            chip.srb1 = false;
            chip.lead_off_positive = 0;
            chip.lead_off_negative = 0;
            for channel in &mut chip.channels {
                channel.on = true;
                channel.input = input;
                channel.srb2 = false;
            }
        }
        self
    }

    /// Returns these settings with lead-off detection on every channel: 6 nA DC into the positive
    /// inputs, comparators at 95 % of the supply. The current adds some noise.
    #[must_use]
    pub const fn with_lead_off(mut self) -> Self {
        self.lead_off = LeadOff {
            comparators: true,
            ..LeadOff::OFF
        };
        let mut chip = 0;
        while chip < CHIPS {
            self.chips[chip].lead_off_positive = 0xFF;
            chip += 1;
        }
        self
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
    pub const ALL: [Self; 7] = [
        Self::X1,
        Self::X2,
        Self::X4,
        Self::X6,
        Self::X8,
        Self::X12,
        Self::X24,
    ];

    /// Returns the gain of a factor; `None` for a factor that the amplifier lacks.
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

    /// Returns the gain as a factor.
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

/// Signal at the input of a channel (CHnSET.MUXn, data sheet section 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// The channel's electrodes.
    Electrodes = 0,
    /// Both inputs at mid-supply, to measure the channel's offset and noise.
    Shorted = 1,
    /// Voltage of the bias electrode; also sets CONFIG3.BIAS_MEAS of the chip.
    BiasMeasurement = 2,
    /// Supply voltages of the chip.
    Supply = 3,
    /// Temperature sensor: 145.3 mV at 25 degrees Celsius, plus 0.49 mV per degree (data sheet
    /// section 9.3.1.1.3).
    Temperature = 4,
    /// Test signal, see [`TestSignal`](crate::settings::TestSignal).
    TestSignal = 5,
    /// Bias drive at the positive input: the electrode of this input is the bias electrode.
    BiasPositive = 6,
    /// Bias drive at the negative input: the electrode of this input is the bias electrode.
    BiasNegative = 7,
}

impl Input {
    /// Every input, in the order of the register's code.
    pub const ALL: [Self; 8] = [
        Self::Electrodes,
        Self::Shorted,
        Self::BiasMeasurement,
        Self::Supply,
        Self::Temperature,
        Self::TestSignal,
        Self::BiasPositive,
        Self::BiasNegative,
    ];
}

/// Square wave generated by a chip (CONFIG2, data sheet section 9.6.1.3). Channels set to
/// [`Input::TestSignal`](crate::settings::Input::TestSignal) convert it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestSignal {
    /// True if the chip's own generator is the source; otherwise the signal is driven at the test
    /// pins.
    pub internal: bool,
    /// Amplitude, which is half of the peak-to-peak voltage.
    pub amplitude: TestAmplitude,
    /// Frequency of the square wave, or DC.
    pub frequency: TestFrequency,
}

/// Amplitude of the test signal (CONFIG2.CAL_AMP), half of peak to peak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestAmplitude {
    /// VREF / 2400: 1.875 mV.
    Single = 0,
    /// VREF / 1200: 3.75 mV.
    Double = 1,
}

/// Frequency of the test signal (CONFIG2.CAL_FREQ); code 2 is not allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestFrequency {
    /// Clock / 2^21: 1 Hz with [`Clock::EEG`](crate::clock::Clock::EEG).
    Slow = 0,
    /// Clock / 2^20: 2 Hz with [`Clock::EEG`](crate::clock::Clock::EEG).
    Fast = 1,
    /// Constant voltage.
    Dc = 3,
}

impl TestSignal {
    /// Signal of the self-test: 1.875 mV, about 1 Hz.
    pub const SELF_TEST: Self = Self {
        internal: true,
        amplitude: TestAmplitude::Single,
        frequency: TestFrequency::Slow,
    };

    /// No internal signal; CONFIG2 as after a reset.
    pub const OFF: Self = Self {
        internal: false,
        ..Self::SELF_TEST
    };
}

impl TestAmplitude {
    /// Returns the amplitude in microvolts.
    pub const fn uv(self) -> f64 {
        VREF * 1e6 / 2400.0 * ((1 + self as u8) as f64)
    }
}

impl TestFrequency {
    /// Returns the number of clock cycles per half period; `None` for DC.
    pub const fn half_period(self) -> Option<u32> {
        match self {
            Self::Slow => Some(1 << 20),
            Self::Fast => Some(1 << 19),
            Self::Dc => None,
        }
    }
}

/// Lead-off detection (LOFF, data sheet section 9.6.1.5): a small current pulls an input to a rail
/// unless it can flow through a good contact. The inputs with a current are selected in
/// [`ChipSettings`](crate::settings::ChipSettings).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeadOff {
    /// Powers the comparators that set the status bits (CONFIG4.PD_LOFF_COMP).
    pub comparators: bool,
    /// Thresholds of the comparators.
    pub threshold: LeadOffThreshold,
    /// Magnitude of the current.
    pub current: LeadOffCurrent,
    /// Frequency of the current.
    pub frequency: LeadOffFrequency,
}

impl LeadOff {
    /// Comparators off; the registers as after a reset.
    pub const OFF: Self = Self {
        comparators: false,
        threshold: LeadOffThreshold::P95,
        current: LeadOffCurrent::Na6,
        frequency: LeadOffFrequency::Dc,
    };
}

/// Thresholds of the comparators on the positive and the negative side, in percent of the supply.
/// They add up to 100 %.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeadOffThreshold {
    /// Positive side 95 %, negative side 5 %.
    P95 = 0,
    /// Positive side 92.5 %, negative side 7.5 %.
    P92_5 = 1,
    /// Positive side 90 %, negative side 10 %.
    P90 = 2,
    /// Positive side 87.5 %, negative side 12.5 %.
    P87_5 = 3,
    /// Positive side 85 %, negative side 15 %.
    P85 = 4,
    /// Positive side 80 %, negative side 20 %.
    P80 = 5,
    /// Positive side 75 %, negative side 25 %.
    P75 = 6,
    /// Positive side 70 %, negative side 30 %.
    P70 = 7,
}

/// Magnitude of the lead-off current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeadOffCurrent {
    /// 6 nA.
    Na6 = 0,
    /// 24 nA.
    Na24 = 1,
    /// 6 uA.
    Ua6 = 2,
    /// 24 uA.
    Ua24 = 3,
}

/// Frequency of the lead-off current.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeadOffFrequency {
    /// Direct current.
    Dc = 0,
    /// Clock / 2^18: 7.8 Hz at 2.048 MHz.
    Clock18 = 1,
    /// Clock / 2^16: 31.2 Hz at 2.048 MHz.
    Clock16 = 2,
    /// A quarter of the sample rate.
    Quarter = 3,
}

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

    /// Returns the clock and the divider for `hz` samples per second; `None` for a rate that
    /// neither an external clock of 2.048 MHz nor [`Clock::EEG`] yields: 250, 500, 1000 .. 16000 Hz
    /// with the one, 256, 512, 1024 .. 16384 Hz with the other.
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

    /// Returns the clock cycles between two samples.
    pub const fn divider(self) -> u32 {
        128 << self as u32
    }

    /// Returns the number of clock cycles from START to the first DRDY, at which the data are
    /// settled. The formula was neither compared with the table in data sheet section 9.4.1 nor
    /// measured.
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
    fn one_count_at_gain_24_is_22_nanovolts() {
        assert!((Gain::X24.lsb_uv() - 22.351_741_790_771_484e-3).abs() < 1e-15);
    }

    #[test]
    fn rates_match_the_data_sheet_and_a_quartz_for_512_hz() {
        let sheet = Rate::ALL.map(|rate| rate.millihertz(Clock::INTERNAL) / 1000);
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
    }
}
