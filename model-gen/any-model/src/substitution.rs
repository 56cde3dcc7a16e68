//! Random tables with which a device substitutes bad electrodes.

use artifact::{
    Description, LARGEST_INNOVATION, SubstitutionDescription, SubstitutionTable,
    SubstitutionTraining,
};

use crate::Noise;

/// Returns the table of a random inverse covariance, `P = A A' / n + I / 4` with uniform random
/// numbers in `A`. P is positive definite, so the sweeps that substitute bad electrodes converge as
/// with a trained table.
pub(crate) fn any_substitution(seed: u32, description: &Description) -> SubstitutionTable {
    let electrodes = description.montage.electrodes.len();
    let mut noise = Noise(!seed);
    let rows: Vec<Vec<f32>> = (0..electrodes).map(|_| noise.fill(electrodes, 1.0)).collect();
    #[expect(clippy::cast_precision_loss, reason = "at most 64 electrodes")]
    let product = |e: usize, other: usize| {
        let products = rows[e].iter().zip(&rows[other]).map(|(a, b)| a * b);
        products.sum::<f32>() / electrodes as f32 + if e == other { 0.25 } else { 0.0 }
    };
    let weight = |e: usize, other: usize| {
        let weight = -product(e, other) / product(e, e) * 128.0;
        #[expect(clippy::cast_possible_truncation, reason = "clamped to 8 bits")]
        let weight = weight.round().clamp(-127.0, 127.0) as i8;
        if e == other { 0 } else { weight }
    };
    let weights = (0..electrodes).flat_map(|e| (0..electrodes).map(move |other| (e, other)));
    SubstitutionTable {
        description: SubstitutionDescription {
            format: 1,
            training: SubstitutionTraining::default(),
        },
        weights: weights.map(|(e, other)| weight(e, other)).collect(),
        innovation: (0..electrodes).map(|e| LARGEST_INNOVATION >> (e % 27)).collect(),
    }
}
