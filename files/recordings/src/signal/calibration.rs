//! Linear conversion of stored (digital) sample values to physical values.

/// Linear scale of a signal: the straight line through the points (`digital_min`, `physical_min`)
/// and (`digital_max`, `physical_max`).
///
/// `physical = (d - digital_min) * gain + physical_min` with
/// `gain = (physical_max - physical_min) / (digital_max - digital_min)`. GDF applies the line to
/// float samples too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Smallest digital value according to the header.
    pub digital_min: f64,
    /// Largest digital value according to the header.
    pub digital_max: f64,
    /// Physical value of `digital_min`, in the signal's unit.
    pub physical_min: f64,
    /// Physical value of `digital_max`, in the signal's unit.
    pub physical_max: f64,
}

impl Calibration {
    /// Returns whether all four numbers are finite and the digital range is not empty.
    pub(crate) fn is_usable(&self) -> bool {
        let range = self.digital_max - self.digital_min;
        range.is_finite() && range != 0.0 && (self.physical_max - self.physical_min).is_finite()
    }

    /// Slope of the scale: physical units per digital unit.
    pub fn gain(&self) -> f64 {
        (self.physical_max - self.physical_min) / (self.digital_max - self.digital_min)
    }

    /// Converts a digital value to the signal's physical unit. Values outside the range given in
    /// the header are not clamped.
    pub fn physical(&self, digital: f64) -> f64 {
        (digital - self.digital_min) * self.gain() + self.physical_min
    }
}
