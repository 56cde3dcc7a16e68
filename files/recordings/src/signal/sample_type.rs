//! Encoding of the samples in a record: integers and floats of several sizes.

/// Encoding of one sample; always little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleType {
    /// Two's complement integer; holds its size, 1 to 8 bytes.
    Signed(u8),
    /// Unsigned integer; holds its size, 1 to 8 bytes.
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

    /// Bytes per sample, 1..=8.
    pub fn bytes(self) -> usize {
        match self {
            Self::Signed(bytes) | Self::Unsigned(bytes) => usize::from(bytes),
            Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// Decodes every whole sample in `raw` and appends `map(digital value)` to `out`. 64-bit integers
    /// beyond 2^53 are rounded to the nearest f64.
    pub(crate) fn decode(self, raw: &[u8], map: impl Fn(f64) -> f64, out: &mut Vec<f64>) {
        let samples = raw.chunks_exact(self.bytes());
        match self {
            Self::Signed(_) => out.extend(samples.map(|s| map(signed(s)))),
            Self::Unsigned(_) => out.extend(samples.map(|s| map(unsigned(s)))),
            Self::Float32 => {
                let value = |s: &[u8]| {
                    s.first_chunk()
                        .map_or(f64::NAN, |&b| f32::from_le_bytes(b).into())
                };
                out.extend(samples.map(|s| map(value(s))));
            }
            Self::Float64 => {
                let value = |s: &[u8]| s.first_chunk().map_or(f64::NAN, |&b| f64::from_le_bytes(b));
                out.extend(samples.map(|s| map(value(s))));
            }
        }
    }
}

/// Returns up to eight little-endian bytes as a u64; missing high bytes are 0.
fn word(raw: &[u8]) -> u64 {
    raw.iter()
        .rev()
        .fold(0, |word, &byte| word << 8 | u64::from(byte))
}

#[expect(
    clippy::cast_precision_loss,
    reason = "rounding beyond 2^53 is documented"
)]
fn unsigned(raw: &[u8]) -> f64 {
    word(raw) as f64
}

#[expect(
    clippy::cast_precision_loss,
    reason = "rounding beyond 2^53 is documented"
)]
fn signed(raw: &[u8]) -> f64 {
    let unused_bits = 64 - 8 * raw.len();
    ((word(raw) << unused_bits).cast_signed() >> unused_bits) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(sample_type: SampleType, raw: &[u8]) -> Vec<f64> {
        let mut out = Vec::new();
        sample_type.decode(raw, |digital| digital, &mut out);
        out
    }

    #[test]
    fn every_gdf_type_keeps_its_sign_and_its_extremes() {
        let sample_type = |number| SampleType::from_gdf(number).expect("known type");
        assert_eq!(decoded(sample_type(1), &[0x80, 0x7f]), [-128.0, 127.0]);
        assert_eq!(decoded(sample_type(2), &[0x80, 0xff]), [128.0, 255.0]);
        assert_eq!(
            decoded(sample_type(3), &[0, 0x80, 0xff, 0x7f]),
            [-32768.0, 32767.0]
        );
        assert_eq!(decoded(sample_type(4), &[0xff, 0xff]), [65535.0]);
        assert_eq!(
            decoded(sample_type(5), &i32::MIN.to_le_bytes()),
            [-2_147_483_648.0]
        );
        assert_eq!(
            decoded(sample_type(6), &u32::MAX.to_le_bytes()),
            [4_294_967_295.0]
        );
        assert_eq!(decoded(sample_type(7), &(-5_i64).to_le_bytes()), [-5.0]);
        assert_eq!(
            decoded(sample_type(8), &(1_u64 << 63).to_le_bytes()),
            [9_223_372_036_854_775_808.0]
        );
        assert_eq!(decoded(sample_type(16), &(-1.5_f32).to_le_bytes()), [-1.5]);
        assert_eq!(decoded(sample_type(17), &0.1_f64.to_le_bytes()), [0.1]);
        assert_eq!(
            decoded(sample_type(279), &[0, 0, 0x80, 0xff, 0xff, 0x7f]),
            [-8_388_608.0, 8_388_607.0]
        );
        assert_eq!(
            decoded(sample_type(535), &[0xff, 0xff, 0xff]),
            [16_777_215.0]
        );
    }

    #[test]
    fn packed_and_unknown_types_are_refused() {
        for number in [0, 9, 15, 18, 255, 255 + 12, 511 + 12, 511 + 72, u32::MAX] {
            assert_eq!(SampleType::from_gdf(number), None, "{number}");
        }
    }
}
