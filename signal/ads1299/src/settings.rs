//! Settings of the ADS1299s in a daisy chain.

use crate::clock::Clock;
use crate::frame::CHANNELS;
use crate::gain::Gain;
use crate::input::Input;
use crate::lead_off::LeadOff;
use crate::rate::Rate;
use crate::test_signal::TestSignal;

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
    /// Uses the chip's internal mid-supply voltage as the amplifier's reference (CONFIG3.BIASREF_INT).
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

    /// Returns settings for EEG against one reference electrode at SRB1, with the bias driven by chip 0
    /// from its positive inputs. No lead-off current, because it adds noise.
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
