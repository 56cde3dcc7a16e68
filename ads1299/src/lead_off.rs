//! Settings of lead-off detection: threshold, current and frequency.

/// Lead-off detection (LOFF, data sheet section 9.6.1.5): a small current pulls an input to a rail
/// unless a good contact drains it. The inputs with a current are selected in
/// [`ChipSettings`](crate::settings::ChipSettings).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeadOff {
    /// Powers the comparators that set the status bits (CONFIG4.PD_LOFF_COMP).
    pub comparators: bool,
    /// Threshold of the comparators.
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

/// Comparator threshold of the positive side, in percent of the supply. The threshold of the
/// negative side is 100 % less this value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeadOffThreshold {
    /// 95 %.
    P95 = 0,
    /// 92.5 %.
    P92_5 = 1,
    /// 90 %.
    P90 = 2,
    /// 87.5 %.
    P87_5 = 3,
    /// 85 %.
    P85 = 4,
    /// 80 %.
    P80 = 5,
    /// 75 %.
    P75 = 6,
    /// 70 %.
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
