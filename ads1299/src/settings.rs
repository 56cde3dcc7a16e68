//! What a chain is to do.

use crate::CHANNELS;
use crate::clock::Clock;
use crate::gain::Gain;
use crate::input::Input;
use crate::lead_off::LeadOff;
use crate::rate::Rate;
use crate::test_signal::TestSignal;

/// What a chain is to do: the registers as typed fields. What all chips share stands here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings<const CHIPS: usize> {
    /// The clock they share.
    pub clock: Clock,
    /// The rate they share.
    pub rate: Rate,
    /// The test signal.
    pub test_signal: TestSignal,
    /// How lost electrodes are found.
    pub lead_off: LeadOff,
    /// What differs from chip to chip; chip 0 is the one at MISO.
    pub chips: [ChipSettings; CHIPS],
}

/// What one chip is to do. Bit n of a byte is channel n, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipSettings {
    /// Its channels.
    pub channels: [Channel; CHANNELS],
    /// Its bias amplifier.
    pub bias: Bias,
    /// SRB1 at every negative input: one reference electrode (MISC1.SRB1, 9.6.1.15).
    pub srb1: bool,
    /// Positive inputs that get the lead-off current.
    pub lead_off_positive: u8,
    /// Negative inputs that get it.
    pub lead_off_negative: u8,
    /// Channels whose current is turned round.
    pub lead_off_flip: u8,
}

/// What one channel is to do (CHnSET, 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel {
    /// Off channels read 0; their input should be [`Input::Shorted`].
    pub on: bool,
    /// Its amplifier.
    pub gain: Gain,
    /// Whether its positive input is tied to SRB2.
    pub srb2: bool,
    /// What it converts.
    pub input: Input,
}

/// The bias amplifier of a chip: it drives the subject to mid-supply against the mains (9.3.2.4.5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bias {
    /// Whether it runs.
    pub on: bool,
    /// Its reference is made inside, at mid-supply.
    pub internal_reference: bool,
    /// Whether its own electrode is watched (CONFIG3.BIAS_LOFF_SENS).
    pub lead_off: bool,
    /// Positive inputs in the average that it answers.
    pub positive: u8,
    /// Negative inputs in it.
    pub negative: u8,
}

impl Bias {
    /// No bias drive.
    pub const OFF: Self = Self {
        on: false,
        internal_reference: false,
        lead_off: false,
        positive: 0,
        negative: 0,
    };
}

impl<const CHIPS: usize> Settings<CHIPS> {
    /// EEG against one reference electrode at SRB1: 512 Hz, gain 24, and the bias driven by chip 0
    /// from its own positive inputs. No lead-off current: it adds noise.
    pub const EEG: Self = {
        let chip = ChipSettings {
            channels: [Channel {
                on: true,
                gain: Gain::X24,
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
            clock: Clock::EEG,
            rate: Rate::Div4096,
            test_signal: TestSignal::OFF,
            lead_off: LeadOff::OFF,
            chips,
        }
    };

    /// The same with every channel on and at one input, for the self-test; with [`Input::TestSignal`] the
    /// chips make [`TestSignal::SELF_TEST`]. No electrode takes part: SRB1 is open, no current flows.
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

    /// The same with every electrode watched: 6 nA of direct current into the positive inputs, and the
    /// comparators at 95 % of the supply. It adds some noise.
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
