//! The square wave that a chip makes for itself.

use crate::gain::VREF;

/// The square wave that a chip makes for itself (CONFIG2, 9.6.1.3); a channel sees it with
/// [`Input::TestSignal`](crate::input::Input::TestSignal).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestSignal {
    /// Made inside; otherwise driven at the test pins.
    pub internal: bool,
    /// How high.
    pub amplitude: TestAmplitude,
    /// How fast.
    pub frequency: TestFrequency,
}

/// Amplitude of the test signal (CONFIG2.CAL_AMP): it swings between plus and minus this.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestAmplitude {
    /// VREF / 2400: 1.875 mV.
    Single = 0,
    /// VREF / 1200: 3.75 mV.
    Double = 1,
}

/// Frequency of the test signal (CONFIG2.CAL_FREQ); 2 is not allowed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestFrequency {
    /// Clock / 2^21: 1 Hz of [`Clock::EEG`](crate::clock::Clock::EEG).
    Slow = 0,
    /// Clock / 2^20.
    Fast = 1,
    /// Constant.
    Dc = 3,
}

impl TestSignal {
    /// The signal of the self-test: 1.875 mV, about 1 Hz.
    pub const SELF_TEST: Self = Self {
        internal: true,
        amplitude: TestAmplitude::Single,
        frequency: TestFrequency::Slow,
    };

    /// None is made; CONFIG2 as after a reset.
    pub const OFF: Self = Self {
        internal: false,
        ..Self::SELF_TEST
    };
}

impl TestAmplitude {
    /// uV.
    pub const fn uv(self) -> f64 {
        VREF * 1e6 / 2400.0 * ((1 + self as u8) as f64)
    }
}

impl TestFrequency {
    /// Cycles of the clock in half a period; none for a constant.
    pub const fn half_period(self) -> Option<u32> {
        match self {
            Self::Slow => Some(1 << 20),
            Self::Fast => Some(1 << 19),
            Self::Dc => None,
        }
    }
}
