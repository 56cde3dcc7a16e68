//! The formats of a file of decoded signals.

/// Format of a file of decoded signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalFormat {
    /// EDF+: 16 bits, tenths of a microvolt, +-3276.7 uV.
    Edf,
    /// BDF+: 24 bits over the ADC's full scale.
    Bdf,
    /// GDF 2.20: float32.
    Gdf,
    /// Arrays for `numpy.load`: float32.
    Npz,
    /// One line per step.
    Csv,
}

impl SignalFormat {
    /// Returns the extension of a file name.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Edf => "edf",
            Self::Bdf => "bdf",
            Self::Gdf => "gdf",
            Self::Npz => "npz",
            Self::Csv => "csv",
        }
    }
}
