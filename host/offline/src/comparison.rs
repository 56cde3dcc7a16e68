//! Measures the error of decoded signals, electrode by electrode.

use std::fmt;

use link::Flags;
use pipeline::Mains;
use recordings::virtual_adc::AdcCounters;

use crate::error::OfflineError;
use crate::exclusions::Exclusions;
use crate::hops::DecodedHop;
use crate::played::Original;

/// Sums of squares over the compared steps of one or several electrodes, uV^2.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ElectrodeSums {
    /// Sum of the squares of the original signal.
    pub signal: f64,
    /// Sum of the squares of the difference between original and decoded signal.
    pub error: f64,
    /// Number of compared values.
    pub steps: u64,
}

impl ElectrodeSums {
    /// Adds a value of the original and the corresponding value of the decoded signal, uV.
    pub fn add(&mut self, original: f32, decoded: f32) {
        self.steps += 1;
        self.signal += f64::from(original).powi(2);
        self.error += f64::from(original - decoded).powi(2);
    }

    /// Returns the percentage root-mean-square difference, `100 sqrt(error / signal)`; infinite or
    /// NaN if the signal is 0.
    pub fn prd_percent(&self) -> f64 {
        100.0 * (self.error / self.signal).sqrt()
    }

    /// Returns the mean squared error per value, uV^2; 0 if there are no values.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 values")]
    pub fn mse_uv2(&self) -> f64 {
        self.error / (self.steps as f64).max(1.0)
    }
}

/// Where the samples of an electrode come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElectrodeOrigin {
    /// The recording has the electrode.
    Measured,
    /// The recording lacks the electrode; its samples are a weighted mean of other electrodes.
    Interpolated,
    /// The recording lacks the electrode; its samples are 0.
    Zero,
}

impl fmt::Display for ElectrodeOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Measured => "measured",
            Self::Interpolated => "interpolated",
            Self::Zero => "zero",
        })
    }
}

/// Returns the time after which the filters of the built-in model have settled, seconds, rounded
/// up. Only a longer recording can be compared.
pub fn settling_s() -> u32 {
    let samples = [Mains::Hz50, Mains::Hz60].map(|mains| mains.filter().settling_samples);
    let samples = samples.into_iter().max().unwrap_or(0);
    samples.div_ceil(model::ADC_RATE_HZ.into())
}

/// A part of the original and of the decoded signal, to be drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Excerpt {
    /// Row of the excerpt's first step, counted from the start of the signal.
    pub first_row: u64,
    /// Original signal at the steps of the excerpt, uV; one entry for each step, with the values of
    /// all electrodes.
    pub original_uv: Vec<Vec<f32>>,
    /// Decoded signal at the steps of `original_uv`, uV, in the same layout.
    pub decoded_uv: Vec<Vec<f32>>,
}

/// Comparison of a filtered recording with the signal decoded from its codes. Leaves out steps
/// before the filters had settled, steps without a code, and steps of an electrode that the device
/// had excluded.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Sums of squares, one entry for each electrode.
    pub electrodes: Vec<ElectrodeSums>,
    /// Where the samples of each electrode come from.
    pub origins: Vec<ElectrodeOrigin>,
    /// Number of compared steps.
    pub steps: u64,
    /// A few seconds of the original and of the decoded signal, from the middle of the recording.
    pub excerpt: Excerpt,
}

impl Comparison {
    /// Returns the sums over all electrodes.
    pub fn total(&self) -> ElectrodeSums {
        sum(self.electrodes.iter())
    }

    /// Returns the sums over the measured electrodes: those that the recording has.
    pub fn total_measured(&self) -> ElectrodeSums {
        let electrodes = self.electrodes.iter().zip(&self.origins);
        sum(electrodes
            .filter(|(_, origin)| **origin == ElectrodeOrigin::Measured)
            .map(|(error, _)| error))
    }

    /// Returns the root mean square of the original over all electrodes, uV.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 values")]
    pub fn rms_uv(&self) -> f64 {
        let total = self.total();
        (total.signal / (total.steps as f64).max(1.0)).sqrt()
    }
}

fn sum<'e>(errors: impl Iterator<Item = &'e ElectrodeSums>) -> ElectrodeSums {
    errors.fold(ElectrodeSums::default(), |total, of| ElectrodeSums {
        signal: total.signal + of.signal,
        error: total.error + of.error,
        steps: total.steps + of.steps,
    })
}

/// Compares decoded hops with the original, each as soon as it is decoded.
pub(crate) struct Comparing {
    original: Original,
    exclusions: Exclusions,
    comparison: Comparison,
    /// Range of the rows that the excerpt keeps.
    shown: std::ops::Range<u64>,
}

impl Comparing {
    /// Creates a comparison that keeps the rows `shown` as an excerpt.
    pub(crate) fn new(
        original: Original,
        exclusions: Exclusions,
        electrodes: usize,
        shown: std::ops::Range<u64>,
    ) -> Self {
        let substitutes = original.played.substitutes;
        let origins = (0..electrodes).map(|electrode| match electrode {
            of if substitutes.interpolated >> of & 1 == 1 => ElectrodeOrigin::Interpolated,
            of if substitutes.zero >> of & 1 == 1 => ElectrodeOrigin::Zero,
            _ => ElectrodeOrigin::Measured,
        });
        Self {
            comparison: Comparison {
                origins: origins.collect(),
                electrodes: vec![ElectrodeSums::default(); electrodes],
                steps: 0,
                excerpt: Excerpt { first_row: shown.start, ..Excerpt::default() },
            },
            original,
            exclusions,
            shown,
        }
    }

    /// Compares the steps of a hop. Ignores steps beyond the end of the original.
    ///
    /// # Errors
    /// The errors of [`Original::next_step`].
    pub(crate) fn add(&mut self, hop: &DecodedHop) -> Result<(), OfflineError> {
        let electrodes = self.comparison.electrodes.len();
        let left_out = [Flags::SETTLING, Flags::FILLER];
        let is_compared = !left_out.iter().any(|flag| hop.flags.contains(*flag));
        for (row, decoded) in (hop.first_row..).zip(hop.uv.chunks_exact(electrodes)) {
            let Some(original) = self.original.next_step()? else {
                return Ok(());
            };
            if self.shown.contains(&row) {
                self.comparison.excerpt.original_uv.push(original.to_vec());
                self.comparison.excerpt.decoded_uv.push(decoded.to_vec());
            }
            if !is_compared {
                continue;
            }
            self.comparison.steps += 1;
            let excluded = self.exclusions.at(row);
            let values = original.iter().zip(decoded);
            let sums = self.comparison.electrodes.iter_mut().zip(values);
            for (electrode, (sums, (original, decoded))) in sums.enumerate() {
                if excluded >> electrode & 1 == 0 {
                    sums.add(*original, *decoded);
                }
            }
        }
        Ok(())
    }

    /// Returns the counts of the original's values that the virtual ADC could not represent.
    pub(crate) fn adc_counters(&self) -> AdcCounters {
        self.original.played.adc.counters()
    }

    pub(crate) fn finish(self) -> Comparison {
        self.comparison
    }
}
