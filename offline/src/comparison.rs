//! The error of decoded signals, electrode by electrode.

use link::Flags;

use crate::error::OfflineError;
use crate::hops::DecodedHop;
use crate::original::Original;

/// Sums over the compared steps of one electrode, uV^2.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ElectrodeError {
    /// Sum of the squared original.
    pub signal: f64,
    /// Sum of the squared difference between original and decoded signal.
    pub error: f64,
}

impl ElectrodeError {
    /// Returns the percentage root-mean-square difference, `100 sqrt(error / signal)`; 0 for an electrode
    /// without signal that was decoded without error.
    pub fn prd_percent(&self) -> f64 {
        if self.error > 0.0 {
            100.0 * (self.error / self.signal).sqrt()
        } else {
            0.0
        }
    }
}

/// A part of both signals, to be drawn.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Excerpt {
    /// Row of the first step.
    pub first_row: u64,
    /// Original, uV, step by step.
    pub original_uv: Vec<Vec<f32>>,
    /// Decoded signal, uV, as many steps.
    pub decoded_uv: Vec<Vec<f32>>,
}

/// Comparison of a recording after the filters with the signal decoded from its codes. Steps before the
/// filters had settled, and those without a code, are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Errors by electrode.
    pub electrodes: Vec<ElectrodeError>,
    /// Whether the recording has the electrode; the others were interpolated from it.
    pub measured: Vec<bool>,
    /// Number of compared steps.
    pub steps: u64,
    /// Some seconds of both signals, from the middle of the recording.
    pub excerpt: Excerpt,
}

impl Comparison {
    /// Returns the errors of all electrodes together.
    pub fn total(&self) -> ElectrodeError {
        sum(self.electrodes.iter())
    }

    /// Returns the errors of the measured electrodes together.
    pub fn total_measured(&self) -> ElectrodeError {
        let electrodes = self.electrodes.iter().zip(&self.measured);
        sum(electrodes
            .filter(|(_, measured)| **measured)
            .map(|(error, _)| error))
    }

    /// Returns the root mean square of the original over all electrodes, uV.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 values")]
    pub fn rms_uv(&self) -> f64 {
        let values = self.steps as f64 * self.electrodes.len() as f64;
        (self.total().signal / values.max(1.0)).sqrt()
    }

    /// Returns the mean squared error of `error`, uV^2, which is a sum over `electrodes` electrodes.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 values")]
    pub fn mse_uv2(&self, error: ElectrodeError, electrodes: usize) -> f64 {
        error.error / (self.steps as f64 * electrodes as f64).max(1.0)
    }
}

fn sum<'e>(errors: impl Iterator<Item = &'e ElectrodeError>) -> ElectrodeError {
    errors.fold(ElectrodeError::default(), |total, of| ElectrodeError {
        signal: total.signal + of.signal,
        error: total.error + of.error,
    })
}

/// Compares hop by hop while they are decoded.
pub(crate) struct Comparing {
    original: Original,
    comparison: Comparison,
    /// Rows of the excerpt.
    shown: std::ops::Range<u64>,
    /// Row of the original's next step.
    next_row: u64,
    /// Row of the original at the first decoded row.
    offset: u64,
}

impl Comparing {
    /// Creates a comparison. `offset` is the row of the original at which the decoded signal starts, `shown`
    /// the decoded rows of the excerpt.
    pub(crate) fn new(
        original: Original,
        electrodes: usize,
        offset: u64,
        shown: std::ops::Range<u64>,
    ) -> Self {
        let missing = original.played.substitutes;
        let missing = missing.interpolated | missing.zero;
        let measured = (0..electrodes).map(|electrode| missing >> electrode & 1 == 0);
        Self {
            comparison: Comparison {
                measured: measured.collect(),
                electrodes: vec![ElectrodeError::default(); electrodes],
                steps: 0,
                excerpt: Excerpt {
                    first_row: shown.start,
                    ..Excerpt::default()
                },
            },
            original,
            shown,
            next_row: 0,
            offset,
        }
    }

    /// Compares the steps of a hop. Ignores steps beyond the end of the original.
    ///
    /// # Errors
    /// Those of [`Original::next_step`].
    pub(crate) fn add(&mut self, hop: &DecodedHop) -> Result<(), OfflineError> {
        let electrodes = self.comparison.electrodes.len();
        let left_out = [Flags::SETTLING, Flags::FILLER];
        let is_compared = !left_out.iter().any(|flag| hop.flags.contains(*flag));
        for (row, decoded) in (hop.first_row..).zip(hop.uv.chunks_exact(electrodes)) {
            let Some(original) = self.step(row + self.offset)? else {
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
            let values = original.iter().zip(decoded);
            for (sums, (original, decoded)) in self.comparison.electrodes.iter_mut().zip(values) {
                sums.signal += f64::from(*original).powi(2);
                sums.error += f64::from(original - decoded).powi(2);
            }
        }
        Ok(())
    }

    pub(crate) fn finish(self) -> Comparison {
        self.comparison
    }

    fn step(&mut self, row: u64) -> Result<Option<[f32; model::ELECTRODES]>, OfflineError> {
        loop {
            let step = self.original.next_step()?;
            self.next_row += 1;
            if step.is_none() || self.next_row > row {
                return Ok(step);
            }
        }
    }
}
