//! Settings of lead-off detection: threshold, current and frequency.

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

/// Thresholds of the comparators on the positive and the negative side, in percent of the supply. They
/// add up to 100 %.
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
