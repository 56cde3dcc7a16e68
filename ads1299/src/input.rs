//! What a channel converts.

/// What a channel converts (CHnSET.MUXn, 9.6.1.6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// Its electrodes.
    Electrodes = 0,
    /// Both inputs at mid-supply: offset and noise of the channel itself.
    Shorted = 1,
    /// The bias signal; sets CONFIG3.BIAS_MEAS.
    BiasMeasurement = 2,
    /// The supplies.
    Supply = 3,
    /// The temperature sensor: 145.3 mV at 25 degrees, 0.49 mV more per degree (9.3.1.1.3).
    Temperature = 4,
    /// The test signal.
    TestSignal = 5,
    /// The bias drive at the positive input: that electrode drives the bias.
    BiasPositive = 6,
    /// The bias drive at the negative input.
    BiasNegative = 7,
}

impl Input {
    /// Every input.
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
