//! Input multiplexer of a channel.

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
    /// Test signal, see [`TestSignal`](crate::test_signal::TestSignal).
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
