//! Computes the signals of a block from its coefficients.

use crate::PackedModel;

/// Maps coefficients to signals with a packed model's synthesis, or with the pseudoinverse of the
/// analysis if the model has none.
#[derive(Clone, Debug)]
pub(crate) struct Synthesis {
    /// Microvolts that one unit of a coefficient adds to a value, `[coefficient][value]`.
    rows: Vec<f32>,
    values: usize,
}

impl Synthesis {
    pub(crate) fn new(model: &PackedModel) -> Self {
        let unit_uv = model.description.unit_uv;
        #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
        let rows = synthesis(model).iter().map(|&value| (value * unit_uv) as f32).collect();
        Self { rows, values: model.analysis.inputs() }
    }

    /// Returns the signals of a block, microvolts, from integer coefficients.
    pub(crate) fn microvolts(&self, coefficients: &[i16]) -> Vec<f32> {
        let coefficients: Vec<f32> = coefficients.iter().map(|&c| f32::from(c)).collect();
        self.microvolts_of(&coefficients)
    }

    /// Returns the signals of a block, microvolts, from coefficients that need not be integers.
    pub(crate) fn microvolts_of(&self, coefficients: &[f32]) -> Vec<f32> {
        let mut microvolts = vec![0.0; self.values];
        let rows = self.rows.chunks_exact(self.values.max(1));
        for (coefficient, row) in coefficients.iter().zip(rows) {
            for (microvolts, value) in microvolts.iter_mut().zip(row) {
                *microvolts += coefficient * value;
            }
        }
        microvolts
    }
}

/// Returns the matrix with which decoders map coefficients to values, `[coefficient][value]`: the
/// model's own, or the pseudoinverse of its analysis. The pseudoinverse is not finite if rows of
/// the analysis are linearly dependent.
pub fn synthesis(model: &PackedModel) -> Vec<f64> {
    if let Some(synthesis) = &model.synthesis {
        return synthesis.iter().map(|&value| f64::from(value)).collect();
    }
    let count = model.coefficients();
    let values = model.analysis.inputs();
    let mut inverse = model.analysis.to_float();
    let rows: Vec<&[f64]> = inverse.chunks_exact(values.max(1)).collect();
    let mut gram = vec![0.0; count * count];
    for (i, row) in rows.iter().enumerate() {
        for (j, other) in rows.iter().enumerate().take(i + 1) {
            let product: f64 = row.iter().zip(*other).map(|(a, b)| a * b).sum();
            gram[i * count + j] = product;
            gram[j * count + i] = product;
        }
    }
    solve(&mut gram, &mut inverse, count, values);
    inverse
}

/// Solves `matrix * x = right` by elimination; x replaces `right`, `[count][columns]`. The
/// `[count][count]` matrix must be positive definite.
fn solve(matrix: &mut [f64], right: &mut [f64], count: usize, columns: usize) {
    for pivot in 0..count {
        let (above, below) = matrix.split_at_mut((pivot + 1) * count);
        let pivot_row = &above[pivot * count..];
        let (right_above, right_below) = right.split_at_mut((pivot + 1) * columns);
        let pivot_right = &right_above[pivot * columns..];
        let rows = below.chunks_exact_mut(count).zip(right_below.chunks_exact_mut(columns));
        for (row, right) in rows {
            let factor = row[pivot] / pivot_row[pivot];
            subtract(&mut row[pivot..], &pivot_row[pivot..], factor);
            subtract(right, pivot_right, factor);
        }
    }
    for pivot in (0..count).rev() {
        let (right_above, right_below) = right.split_at_mut((pivot + 1) * columns);
        let row = &matrix[pivot * count..][..count];
        let solution = &mut right_above[pivot * columns..];
        for (later, known) in row[pivot + 1..].iter().zip(right_below.chunks_exact(columns)) {
            subtract(solution, known, *later);
        }
        for value in solution {
            *value /= row[pivot];
        }
    }
}

fn subtract(values: &mut [f64], other: &[f64], factor: f64) {
    for (value, other) in values.iter_mut().zip(other) {
        *value -= factor * other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_with_a_known_solution_is_solved() {
        let mut matrix = [4.0, 2.0, 0.0, 2.0, 5.0, 1.0, 0.0, 1.0, 3.0];
        // The right-hand sides of the equations for the solutions x = (1, 2, 3) and x = (0, -1, 2).
        let mut right = [8.0, -2.0, 15.0, -3.0, 11.0, 5.0];
        solve(&mut matrix, &mut right, 3, 2);
        for (value, expected) in right.iter().zip([1.0, 0.0, 2.0, -1.0, 3.0, 2.0]) {
            assert!((value - expected).abs() < 1e-12, "{right:?}");
        }
    }
}
