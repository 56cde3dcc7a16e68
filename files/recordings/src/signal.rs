//! One signal of a recording, as the header describes it: unit, scale and encoding.

use std::fmt;

use thiserror::Error;

use crate::{header::array_at, ratio::Ratio};

/// What a signal of a file holds. EDF and BDF files also store annotations as signals.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalKind {
    /// Samples of a measured quantity.
    Samples,
    /// EDF+ or BDF+ annotations, which [`crate::Recording::events`] returns.
    Annotations,
}

/// One signal of a recording: its label, unit, scale and encoding.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Label exactly as in the file, without padding.
    pub label: String,
    /// What the signal holds: samples or annotations.
    pub kind: SignalKind,
    /// Unit of the physical values.
    pub unit: Unit,
    /// Conversion from digital to physical values. Signals without a calibration are not read.
    pub calibration: Result<Calibration, UnusableRange>,
    /// Encoding of each sample in the file.
    pub sample_type: SampleType,
    /// Number of samples in a record; 0 for a signal that only has events.
    pub samples_per_record: u32,
    /// Samples per second, Hz; `None` if the signal has no samples or a record has no duration.
    pub rate: Option<Ratio>,
}

impl Signal {
    /// Returns the length of this signal's part of a record in bytes, < 2^35.
    pub(crate) fn record_bytes(&self) -> u64 {
        // No overflow: at most 2^32 - 1 samples of 8 bytes.
        u64::from(self.samples_per_record) * self.sample_type.bytes() as u64
    }
}

/// Linear scale of a signal: the straight line through the points (digital minimum, physical
/// minimum) and (digital maximum, physical maximum). GDF applies the line to float samples too.
///
/// `physical = (d - d0) * gain + p0` with
/// `gain = (physical_max - physical_min) / (digital_max - digital_min)`. (d0, p0) is the point of
/// the line whose d0 is nearest to 0 within the digital range, or (0, 0) if both ranges are equal.
/// An end of the range would be a poor choice, because a small sample is rounded away if the range
/// is wide: some programs state +-3.4e38, the range of the type, for float samples of 20 uV.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    /// Digital minimum and maximum that the header states.
    pub(crate) digital: [f64; 2],
    /// Physical values of `digital`, in the signal's unit.
    pub(crate) physical: [f64; 2],
    gain: f64,
    /// The point (d0, p0) in the formula of [`Calibration`]: a digital value and its physical
    /// value.
    nearest_zero: [f64; 2],
}

impl Calibration {
    /// The calibration whose physical values equal the digital values.
    pub(crate) const IDENTITY: Self =
        Self { digital: [-1.0, 1.0], physical: [-1.0, 1.0], gain: 1.0, nearest_zero: [0.0, 0.0] };

    /// Creates the line through (digital minimum, physical minimum) and (digital maximum, physical
    /// maximum); `None` unless all ends are finite and the gain is finite and not 0.
    pub(crate) fn new(digital: [f64; 2], physical: [f64; 2]) -> Option<Self> {
        // Exact scaling by powers of two prevents overflow in differences and products of the ends.
        let [digital_unit, physical_unit] = [digital, physical].map(power_of_two);
        let [d_min, d_max] = digital.map(|end| end / digital_unit);
        let [p_min, p_max] = physical.map(|end| end / physical_unit);
        let slope = (p_max - p_min) / (d_max - d_min);
        let gain = slope * (physical_unit / digital_unit);
        #[expect(clippy::float_cmp, reason = "equal as stored means that values are not scaled")]
        let nearest_zero = if digital == physical {
            [0.0, 0.0]
        } else if d_min * d_max <= 0.0 {
            let offset = difference_of_products([p_min, d_max], [p_max, d_min]) / (d_max - d_min);
            [0.0, offset * physical_unit]
        } else if d_min.abs() < d_max.abs() {
            [digital[0], physical[0]]
        } else {
            [digital[1], physical[1]]
        };
        let line = Self { digital, physical, gain, nearest_zero };
        let finite = digital.iter().chain(&physical).all(|end| end.is_finite());
        (finite && gain.is_normal()).then_some(line)
    }

    /// Returns the slope of the scale: physical units per digital unit.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Converts a digital value to the signal's physical unit. Values outside the range in the
    /// header are not clipped.
    pub fn physical(&self, digital: f64) -> f64 {
        let [d0, p0] = self.nearest_zero;
        (digital - d0) * self.gain + p0
    }
}

/// Returns the largest power of two that is not above the larger magnitude of the two ends.
fn power_of_two(ends: [f64; 2]) -> f64 {
    let [a, b] = ends.map(f64::abs);
    // A float without its fraction bits is a power of two.
    f64::from_bits(a.max(b).max(f64::MIN_POSITIVE).to_bits() & !0 << 52)
}

/// Computes `a * b - c * d` within 1.5 units in the last place by Kahan's algorithm: a fused
/// multiply-add yields the rounding error of `c * d`. Source: C.-P. Jeannerod, N. Louvet, J.-M.
/// Muller, "Further analysis of Kahan's algorithm for the accurate computation of 2 x 2
/// determinants", 2013.
fn difference_of_products([a, b]: [f64; 2], [c, d]: [f64; 2]) -> f64 {
    let product = c * d;
    let error = (-c).mul_add(d, product);
    a.mul_add(b, -product) + error
}

/// Why a signal has no [`Calibration`]. The text states the signal's ranges, as in the header.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct UnusableRange(String);

impl UnusableRange {
    /// Creates the reason from the ends of the digital and of the physical range.
    pub(crate) fn new([digital, physical]: [[String; 2]; 2]) -> Self {
        let [digital, physical] = [digital, physical].map(|ends| ends.join(".."));
        Self(format!("digital {digital}, physical {physical}"))
    }
}

/// Encoding of one sample in a file; always little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleType {
    /// Two's complement integer of this length in bytes, 1 to 8.
    Signed(u8),
    /// Unsigned integer of this length in bytes, 1 to 8.
    Unsigned(u8),
    /// IEEE 754 single precision.
    Float32,
    /// IEEE 754 double precision.
    Float64,
}

impl SampleType {
    /// Converts a GDF type number: 1 i8, 2 u8, 3 i16, 4 u16, 5 i32, 6 u32, 7 i64, 8 u64, 16 f32,
    /// 17 f64, 255+n signed and 511+n unsigned integers of n bits, where n is a multiple of 8 up to
    /// 64. Returns `None` for packed bit fields and 128-bit floats.
    pub fn from_gdf(number: u32) -> Option<Self> {
        let bytes = |bits: u32| match bits {
            8 | 16 | 24 | 32 | 40 | 48 | 56 | 64 => u8::try_from(bits / 8).ok(),
            _ => None,
        };
        match number {
            1 => Some(Self::Signed(1)),
            2 => Some(Self::Unsigned(1)),
            3 => Some(Self::Signed(2)),
            4 => Some(Self::Unsigned(2)),
            5 => Some(Self::Signed(4)),
            6 => Some(Self::Unsigned(4)),
            7 => Some(Self::Signed(8)),
            8 => Some(Self::Unsigned(8)),
            16 => Some(Self::Float32),
            17 => Some(Self::Float64),
            256..=511 => bytes(number - 255).map(Self::Signed),
            512.. => bytes(number - 511).map(Self::Unsigned),
            _ => None,
        }
    }

    /// Returns the length of a sample in bytes, 1..=8.
    pub fn bytes(self) -> usize {
        match self {
            Self::Signed(bytes) | Self::Unsigned(bytes) => usize::from(bytes),
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// Returns whether both ranges of a signal are the range of a float type, except for rounding:
    /// all ends are within 1 % of the type's smallest and largest number. Such ranges state no
    /// scale.
    pub(crate) fn is_whole_range(self, digital: [f64; 2], physical: [f64; 2]) -> bool {
        let is_float = matches!(self, Self::Float32 | Self::Float64);
        let near = |value: f64, end: f64| (value / end - 1.0).abs() <= 0.01;
        let is_range = |[least, most]: [f64; 2]| {
            let ends = [f64::from(f32::MAX), f64::MAX];
            ends.iter().any(|end| near(least, -end) && near(most, *end))
        };
        is_float && is_range(digital) && is_range(physical)
    }

    /// Decodes every whole sample in `raw`, applies `map` to the digital value, and appends the
    /// result to `out`. 64-bit integers beyond 2^53 are rounded to the nearest f64.
    pub(crate) fn decode(self, raw: &[u8], map: impl Fn(f64) -> f64, out: &mut Vec<f64>) {
        let samples = raw.chunks_exact(self.bytes());
        match self {
            Self::Signed(_) => out.extend(samples.map(|s| map(signed(s)))),
            Self::Unsigned(_) => out.extend(samples.map(|s| map(unsigned(s)))),
            Self::Float32 => {
                let value = |s| f64::from(f32::from_le_bytes(array_at(s, 0)));
                out.extend(samples.map(|s| map(value(s))));
            }
            Self::Float64 => {
                let value = |s| f64::from_le_bytes(array_at(s, 0));
                out.extend(samples.map(|s| map(value(s))));
            }
        }
    }
}

/// Returns up to eight little-endian bytes as a u64, in which missing high bytes are 0.
fn word(raw: &[u8]) -> u64 {
    raw.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
}

#[expect(clippy::cast_precision_loss, reason = "rounding beyond 2^53 is documented")]
fn unsigned(raw: &[u8]) -> f64 {
    word(raw) as f64
}

#[expect(clippy::cast_precision_loss, reason = "rounding beyond 2^53 is documented")]
fn signed(raw: &[u8]) -> f64 {
    let unused_bits = 64 - 8 * raw.len();
    ((word(raw) << unused_bits).cast_signed() >> unused_bits) as f64
}

/// Unit of a signal: its text in the file and, for a supported voltage, its size in uV.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    text: String,
    microvolts: Option<f64>,
}

/// GDF 2 code of the unit volt. The lowest five bits of a code are the decimal prefix (GDF 2
/// specification, table of physical dimensions, after ISO/IEEE 11073-10101).
const GDF_VOLT: u16 = 4256;

impl Unit {
    /// Parses the unit text of a header: `uV`, `mV`, `V` or `nV`, where the micro sign may have any
    /// encoding. Any other text is kept as an unknown unit.
    pub fn from_text(text: &str) -> Self {
        let text = text.trim();
        let microvolts = match text.replace(['µ', 'μ'], "u").as_str() {
            "nV" | "nv" => Some(1e-3),
            "uV" | "uv" | "UV" => Some(1.0),
            "mV" | "mv" => Some(1e3),
            "V" | "v" => Some(1e6),
            _ => None,
        };
        Self { text: text.to_owned(), microvolts }
    }

    /// Interprets a GDF 2 unit code: 4256 V, 4274 mV, 4275 uV, 4276 nV. Code 0 means that the
    /// header states the unit only as `text`.
    pub fn from_gdf_code(code: u16, text: &str) -> Self {
        if code == 0 {
            return Self::from_text(text);
        }
        let (name, microvolts) = match code.checked_sub(GDF_VOLT) {
            Some(0) => ("V", Some(1e6)),
            Some(18) => ("mV", Some(1e3)),
            Some(19) => ("uV", Some(1.0)),
            Some(20) => ("nV", Some(1e-3)),
            _ => (text.trim(), None),
        };
        let text = if name.is_empty() { format!("code {code}") } else { name.to_owned() };
        Self { text, microvolts }
    }

    /// Returns the unit's size in microvolts; `None` unless it is a supported voltage.
    pub fn microvolts(&self) -> Option<f64> {
        self.microvolts
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.text.is_empty() { "(none)" } else { &self.text })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voltages_are_recognised_by_text() {
        for (text, microvolts) in
            [("uV", 1.0), (" µV ", 1.0), ("μV", 1.0), ("mV", 1e3), ("V", 1e6), ("nV", 1e-3)]
        {
            assert_eq!(Unit::from_text(text).microvolts(), Some(microvolts), "{text}");
        }
    }

    #[test]
    fn types_have_the_sizes_of_the_specification_and_others_are_refused() {
        use SampleType::{Float32, Float64, Signed, Unsigned};
        for (number, expected) in [
            (1, Signed(1)),
            (2, Unsigned(1)),
            (3, Signed(2)),
            (4, Unsigned(2)),
            (5, Signed(4)),
            (6, Unsigned(4)),
            (7, Signed(8)),
            (8, Unsigned(8)),
            (16, Float32),
            (17, Float64),
            (279, Signed(3)),
            (535, Unsigned(3)),
        ] {
            assert_eq!(SampleType::from_gdf(number), Some(expected), "{number}");
        }
        for number in [0, 9, 15, 18, 255, 255 + 12, 511 + 12, 511 + 72, u32::MAX] {
            assert_eq!(SampleType::from_gdf(number), None, "{number}");
        }
    }

    #[test]
    fn other_units_are_not_guessed() {
        for text in ["", "Boolean", "MV", "degC"] {
            assert_eq!(Unit::from_text(text).microvolts(), None, "{text}");
        }
        assert_eq!(Unit::from_gdf_code(512, "").to_string(), "code 512");
    }
}
