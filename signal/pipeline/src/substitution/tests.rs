#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    reason = "numbers of steps, and microvolts"
)]

use std::boxed::Box;
use std::vec::Vec;

use int8_nn::{Linear, Pair};
use model::{
    COLUMNS, ELECTRODE_OUTPUTS, ELECTRODE_PAIRS, ELECTRODES, GRID_CELL, GUARD_BITS, LSB_NV,
};

use super::*;
use crate::{Electrodes, quantise};

type Matrix = Vec<[f64; ELECTRODES]>;

/// Returns the covariance of a signal that is similar at neighbouring electrodes, uV^2.
fn covariance() -> Matrix {
    let place = |electrode: usize| {
        let cell = usize::from(GRID_CELL[electrode]);
        [cell / COLUMNS, cell % COLUMNS].map(|x| f64::from(u8::try_from(x).unwrap()))
    };
    let between = |a, b| {
        let ([ra, ca], [rb, cb]) = (place(a), place(b));
        let distance = (ra - rb).hypot(ca - cb);
        400.0 * (-distance / 3.0).exp() + if a == b { 4.0 } else { 0.0 }
    };
    let row = |a| core::array::from_fn(|b| between(a, b));
    (0..ELECTRODES).map(row).collect()
}

/// Returns the inverse of a positive definite matrix (Gauss and Jordan).
fn inverse(matrix: &Matrix) -> Matrix {
    let mut left = matrix.clone();
    let unit = |row| core::array::from_fn(|column| f64::from(u8::from(row == column)));
    let mut right: Matrix = (0..ELECTRODES).map(unit).collect();
    for pivot in 0..ELECTRODES {
        let scale = 1.0 / left[pivot][pivot];
        for matrix in [&mut left, &mut right] {
            matrix[pivot] = matrix[pivot].map(|x| x * scale);
        }
        for row in (0..ELECTRODES).filter(|&row| row != pivot) {
            let factor = left[row][pivot];
            for matrix in [&mut left, &mut right] {
                let of_pivot = matrix[pivot];
                for (x, y) in matrix[row].iter_mut().zip(of_pivot) {
                    *x -= factor * y;
                }
            }
        }
    }
    right
}

/// Returns the lower triangular root of a covariance (Cholesky).
fn root(covariance: &Matrix) -> Matrix {
    let mut root: Matrix = (0..ELECTRODES).map(|_| [0.0; ELECTRODES]).collect();
    for row in 0..ELECTRODES {
        for column in 0..=row {
            let products = (0..column).map(|k| root[row][k] * root[column][k]);
            let rest = covariance[row][column] - products.sum::<f64>();
            root[row][column] =
                if row == column { rest.sqrt() } else { rest / root[column][column] };
        }
    }
    root
}

/// Returns the weights of the table for a covariance, in Q7 and row by row, and the table itself.
fn table(covariance: &Matrix) -> (Vec<[i8; ELECTRODES]>, Table<'static>) {
    let precision = inverse(covariance);
    let row = |a: usize| {
        core::array::from_fn(|b| {
            let weight = -precision[a][b] / precision[a][a] * 128.0;
            if a == b { 0 } else { weight.round() as i8 }
        })
    };
    let rows: Vec<[i8; ELECTRODES]> = (0..ELECTRODES).map(row).collect();
    let innovation = |a: usize| (256.0 / precision[a][a]).round() as i32;
    (rows.clone(), packed(&rows, core::array::from_fn(innovation)))
}

fn packed(rows: &[[i8; ELECTRODES]], innovation: [i32; ELECTRODES]) -> Table<'static> {
    let mut by_input = Vec::new();
    for input in 0..ELECTRODES {
        by_input.extend((0..ELECTRODE_OUTPUTS).map(|output| {
            let row = rows.get(output);
            row.map_or(0, |row| row[input])
        }));
    }
    let mut weights = std::vec![Pair::ZERO; ELECTRODE_PAIRS * ELECTRODE_OUTPUTS / 2];
    Linear::pack_weights(ELECTRODE_PAIRS, ELECTRODE_OUTPUTS, &by_input, &mut weights);
    Table {
        prediction: Linear {
            inputs: ELECTRODE_PAIRS,
            outputs: ELECTRODE_OUTPUTS,
            weights: Vec::leak(weights),
        },
        innovation: Box::leak(Box::new(innovation)),
    }
}

/// Pseudo-random noise that is the same in every run of the tests.
struct Noise(u32);

impl Noise {
    /// Returns a number with mean 0 and standard deviation 1, nearly normal.
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(self.0 >> 8) / 16_777_216.0 - 0.5
        };
        (0..12).map(|_| uniform()).sum()
    }
}

/// Returns the number of units of a filtered step (counts in Q27.5) per microvolt.
fn counts_per_uv() -> f64 {
    1_000.0 * f64::from(1_u16 << GUARD_BITS) / f64::from(LSB_NV)
}

/// Returns `count` steps of a signal with the covariance of [`covariance`], uV.
fn signal(count: usize) -> Vec<[f64; ELECTRODES]> {
    let root = root(&covariance());
    let mut noise = Noise(1);
    let mut step = || {
        let source: [f64; ELECTRODES] = core::array::from_fn(|_| noise.next());
        core::array::from_fn(|row| root[row].iter().zip(&source).map(|(a, b)| a * b).sum())
    };
    (0..count).map(|_| step()).collect()
}

fn step(uv: &[f64; ELECTRODES]) -> Step {
    let electrodes = uv.map(|x| (x * counts_per_uv()) as i32);
    let (plane, clipped) = quantise(&electrodes);
    Step { electrodes, plane, clipped, ..Step::SILENCE }
}

/// Runs the substitution over steps; each step is preceded by one sample, constant at the
/// electrodes in `flat` and changing at all others. Returns the excluded electrodes and the output
/// at each step.
fn run(
    policy: ExclusionPolicy,
    table: &Table<'_>,
    steps: &[Step],
    flat: ElectrodeMask,
) -> Vec<(ElectrodeMask, Step)> {
    let mut substitution = Substitution::NEW;
    let mut outputs = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        let mut sample = Sample::default();
        for (electrode, count) in sample.counts.iter_mut().enumerate() {
            *count = if flat >> electrode & 1 == 0 { (index % 2 * 1_000) as i32 } else { 77 };
        }
        substitution.observe_sample(&sample);
        let mut filled = *step;
        substitution.fill_step(&mut filled, policy, table);
        outputs.push((filled.excluded, filled));
    }
    outputs
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let values: Vec<f64> = values.collect();
    (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn steps_pass_unchanged_while_no_electrode_is_bad() {
    let (_, table) = table(&covariance());
    let steps: Vec<Step> = signal(20 * WINDOW).iter().map(step).collect();
    for ((excluded, filled), step) in
        run(ExclusionPolicy::AUTOMATIC, &table, &steps, 0).iter().zip(&steps)
    {
        assert_eq!((*excluded, filled.electrodes), (0, step.electrodes));
    }
}

/// The reference is the conditional mean, computed from the covariance in floating point.
#[test]
fn excluded_electrodes_are_their_conditional_mean_given_the_others() {
    let covariance = covariance();
    let (_, table) = table(&covariance);
    let uv = signal(WINDOW);
    let steps: Vec<Step> = uv.iter().map(step).collect();
    let adjacent: Vec<usize> = (20..20 + MAX_EXCLUDED).collect();
    let spread: Vec<usize> = (0..MAX_EXCLUDED).map(|n| 5 * n).collect();
    for bad in [&adjacent[..], &spread, &adjacent[..1]] {
        let always = bad.iter().fold(0, |mask, electrode| mask | 1 << electrode);
        let policy = ExclusionPolicy { always, automatic: false, never: 0 };
        let outputs = run(policy, &table, &steps, 0);
        let reference = conditional_mean(&covariance, bad);
        let mut errors = Vec::new();
        let mut expected = Vec::new();
        for (uv, (excluded, filled)) in uv.iter().zip(&outputs) {
            assert_eq!(*excluded, always);
            let quantised = quantise(&filled.electrodes);
            assert_eq!((filled.plane, filled.clipped), quantised);
            for electrode in 0..ELECTRODES {
                let value = f64::from(filled.electrodes[electrode]) / counts_per_uv();
                if let Some(place) = bad.iter().position(|&bad| bad == electrode) {
                    let mean = reference[place].iter().zip(uv).map(|(w, x)| w * x).sum::<f64>();
                    errors.push(value - mean);
                    expected.push(mean);
                } else {
                    assert_eq!(filled.electrodes[electrode], step(uv).electrodes[electrode]);
                }
            }
        }
        let (error, expected) = (rms(errors.into_iter()), rms(expected.into_iter()));
        // The error comes from weights with 7 fractional bits and from stopping after eight sweeps.
        assert!(error < 0.06 * expected, "{error} of {expected} uV, {bad:?}");
    }
}

/// Returns, for each electrode in `bad`, the weights of all electrodes in its conditional mean: the
/// solution of P_bb x_b = -P_bg x_g, where P is the inverse covariance.
fn conditional_mean(covariance: &Matrix, bad: &[usize]) -> Matrix {
    let precision = inverse(covariance);
    let mut rows: Matrix = bad.iter().map(|&b| precision[b]).collect();
    for pivot in 0..bad.len() {
        let scale = 1.0 / rows[pivot][bad[pivot]];
        rows[pivot] = rows[pivot].map(|x| x * scale);
        for row in (0..bad.len()).filter(|&row| row != pivot) {
            let factor = rows[row][bad[pivot]];
            let of_pivot = rows[pivot];
            for (x, y) in rows[row].iter_mut().zip(of_pivot) {
                *x -= factor * y;
            }
        }
    }
    for row in &mut rows {
        *row = row.map(|x| -x);
        for &b in bad {
            row[b] = 0.0;
        }
    }
    rows
}

/// Computes a bad electrode's value in uV. Arguments: the index of the step, the value without the
/// fault in uV, and a noise source.
type Fault = fn(usize, f64, &mut Noise) -> f64;

/// A pop of 75 uV that lasts one window excludes no electrode; a pop that lasts two windows
/// excludes its electrode.
#[test]
fn a_short_pop_excludes_no_electrode() {
    const BAD: usize = 30;
    let (_, table) = table(&covariance());
    for (windows, expected) in [(1, 0), (2, 1 << BAD)] {
        let mut uv = signal(12 * WINDOW);
        for uv in &mut uv[6 * WINDOW..(6 + windows) * WINDOW] {
            uv[BAD] += 75.0;
        }
        let steps: Vec<Step> = uv.iter().map(step).collect();
        let masks = run(ExclusionPolicy::AUTOMATIC, &table, &steps, 0);
        let excluded = masks.iter().fold(0, |all, (mask, _)| all | mask);
        assert_eq!(excluded, expected, "{windows} windows");
    }
}

/// Faults from window 4, counted from 0, to the end of window 13: each is found within the stated
/// number of windows, no other electrode is excluded, and the electrode returns 10 s after the end.
#[test]
fn each_fault_is_found_and_the_electrode_returns() {
    const BAD: usize = 30;
    let (begin, end) = (4 * WINDOW + 10, 14 * WINDOW);
    let (_, table) = table(&covariance());
    let uv = signal(40 * WINDOW);
    let faults: [(&str, Fault, usize); 4] = [
        ("mains", |n, _, _| 141.0 * (TAU * 50.05 * n as f64 / 128.0).sin(), 2),
        ("noise", |_, _, noise| 100.0 * noise.next(), 1),
        ("quiet", |_, x, _| x / 10.0, 8),
        ("pop", |_, x, _| x + 1_000.0, 1),
    ];
    for (name, fault, windows) in faults {
        let mut noise = Noise(2);
        let steps: Vec<Step> = (0..uv.len())
            .map(|n| {
                let mut uv = uv[n];
                if (begin..end).contains(&n) {
                    uv[BAD] = fault(n, uv[BAD], &mut noise);
                }
                step(&uv)
            })
            .collect();
        let masks: Vec<ElectrodeMask> = run(ExclusionPolicy::AUTOMATIC, &table, &steps, 0)
            .iter()
            .map(|(mask, _)| *mask)
            .collect();
        let found = masks.iter().position(|&mask| mask != 0);
        let found = found.unwrap_or_else(|| panic!("{name} is not found"));
        assert!(found <= (4 + windows + 1) * WINDOW, "{name} found at {found}");
        assert!(masks.iter().all(|mask| mask & !(1 << BAD) == 0), "{name}: others");
        let back = found + masks[found..].iter().position(|&mask| mask == 0).unwrap();
        let hold = usize::from(judge::HOLD) * WINDOW;
        assert!((end + hold..end + hold + 2 * WINDOW).contains(&back), "{name}: {back}");
    }
}

const TAU: f64 = std::f64::consts::TAU;

/// The typical innovation of this electrode is 24 uV RMS, as over a temporal muscle. The relative
/// limit, 50 times the typical energy, is then 170 uV RMS, so that noise of 100 uV exceeds only the
/// absolute limit of 70 uV.
#[test]
fn an_electrode_with_large_innovations_in_training_is_excluded_for_noise() {
    const BAD: usize = 30;
    let (_, table) = table(&covariance());
    let mut innovation = *table.innovation;
    innovation[BAD] = 24 * 24 * 256;
    let table = Table { innovation: &innovation, ..table };
    for (noise_uv, expected) in [(100.0, 1 << BAD), (55.0, 0)] {
        let mut noise = Noise(2);
        let mut uv = signal(8 * WINDOW);
        for uv in &mut uv {
            uv[BAD] = noise_uv * noise.next();
        }
        let steps: Vec<Step> = uv.iter().map(step).collect();
        let excluded = run(ExclusionPolicy::AUTOMATIC, &table, &steps, 0);
        let excluded = excluded.last().map(|(mask, _)| mask & 1 << BAD);
        assert_eq!(excluded, Some(expected), "{noise_uv} uV");
    }
}

#[test]
fn an_electrode_at_the_rail_is_excluded_with_that_step() {
    let (_, table) = table(&covariance());
    let mut steps: Vec<Step> = signal(2 * WINDOW).iter().map(step).collect();
    steps[70].saturated = 1 << 9 | 1 << 63;
    steps[70].electrodes[9] = i32::MAX;
    let outputs = run(ExclusionPolicy::AUTOMATIC, &table, &steps, 0);
    assert_eq!((outputs[69].0, outputs[70].0), (0, 1 << 9));
    assert!(outputs[70].1.electrodes[9] < 1_000_000);
    assert_eq!(outputs[70].1.saturated, 1 << 63 & !(1 << 9));
    assert_eq!(outputs[70].1.clipped, 0);
}

#[test]
fn a_flat_electrode_is_excluded_after_one_window() {
    let (_, table) = table(&covariance());
    let steps: Vec<Step> = signal(2 * WINDOW).iter().map(step).collect();
    let outputs = run(ExclusionPolicy::AUTOMATIC, &table, &steps, 1 << 5);
    assert_eq!((outputs[WINDOW - 1].0, outputs[WINDOW].0), (0, 1 << 5));
}

/// While the host protects a flat electrode, an electrode with a pop is still found.
#[test]
fn a_protected_electrode_does_not_end_the_search_for_others() {
    let (_, table) = table(&covariance());
    let mut uv = signal(4 * WINDOW);
    for uv in &mut uv[2 * WINDOW..] {
        uv[30] += 1_000.0;
    }
    let steps: Vec<Step> = uv.iter().map(step).collect();
    let policy = ExclusionPolicy { never: 1 << 5, ..ExclusionPolicy::AUTOMATIC };
    let outputs = run(policy, &table, &steps, 1 << 5);
    assert_eq!(outputs.last().map(|(mask, _)| *mask), Some(1 << 30));
}

/// Electrodes that the host excludes take the slots of electrodes that the device has excluded.
#[test]
fn the_host_comes_first() {
    let (_, table) = table(&covariance());
    let mut fill = Fill::NONE;
    fill.exclude(0xfff, &table);
    fill.exclude_first(0xff << 20, &table);
    assert_eq!(fill.excluded(), 0xf00 | 0xff << 20);
}

#[test]
fn the_host_excludes_protects_and_switches_off() {
    let (_, table) = table(&covariance());
    let railed = Step { saturated: 1 << 2 | 1 << 3, ..Step::SILENCE };
    let steps = std::vec![railed; 3 * WINDOW];
    let excluded = |always, never, automatic| {
        let policy = ExclusionPolicy { always, never, automatic };
        run(policy, &table, &steps, 0)[WINDOW / 2].0
    };
    assert_eq!(excluded(0, 0, true), 0b1100);
    assert_eq!(excluded(1, 0b100, true), 0b1001);
    assert_eq!(excluded(1, 1, false), 1);
    assert_eq!(excluded(0, 0, false), 0);
    // The host excludes more electrodes than there are slots.
    assert_eq!(excluded(u64::MAX, 0, true).count_ones() as usize, MAX_EXCLUDED);
}

#[test]
fn no_table_makes_the_arithmetic_overflow() {
    for sign in [1, -1] {
        let rows: Vec<[i8; ELECTRODES]> = (0..ELECTRODES)
            .map(|row| {
                core::array::from_fn(
                    |column| {
                        if (row + column) % 3 == 0 { -127 } else { 127 * sign }
                    },
                )
            })
            .collect();
        for innovation in [1, 1 << 26] {
            let table = packed(&rows, [innovation; ELECTRODES]);
            let steps = (0..3 * WINDOW).map(|n| Step {
                electrodes: Electrodes::from(core::array::from_fn(|e| {
                    if (n * e) % 2 == 0 { i32::MAX } else { i32::MIN }
                })),
                saturated: if n % 50 == 0 { n as u64 * 0x1234_5678_9abc } else { 0 },
                ..Step::SILENCE
            });
            run(ExclusionPolicy::AUTOMATIC, &table, &steps.collect::<Vec<_>>(), 0);
        }
    }
}
