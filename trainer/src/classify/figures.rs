//! Figures of a classifier: accuracy with confidence interval, area under the ROC curve (AUC) and
//! confusion matrix.

use artifact::classifier::{ClassifierFigures, PartFigures};
use std::fmt;

/// 97.5 % quantile of the normal distribution, for a two-sided interval of 95 %.
const Z95: f64 = 1.959_963_985;

/// The decisions on the trials of a recording, or of a block of trials.
pub(super) struct Part {
    pub(super) name: String,
    pub(super) decided: Vec<Decided>,
}

/// The decision on one trial.
pub(super) struct Decided {
    /// Index of the true class.
    pub(super) class: usize,
    /// Index of the class that was decided.
    pub(super) decision: usize,
    /// Score of each class; only the differences between scores matter.
    pub(super) scores: Vec<f64>,
    /// Scores from unquantised filters and features.
    pub(super) float_scores: Vec<f64>,
}

/// Returns the figures of decisions. The area under the ROC curve compares only trials of the same
/// part.
pub(super) fn figures(parts: &[Part], classes: usize) -> ClassifierFigures {
    let mut confusion = vec![vec![0; classes]; classes];
    for decided in parts.iter().flat_map(|part| &part.decided) {
        confusion[decided.class][decided.decision] += 1;
    }
    let right: u32 = (0..classes).map(|class| confusion[class][class]).sum();
    let trials: u32 = confusion.iter().flatten().sum();
    let parts_figures = parts.iter().map(|part| {
        let right = part.decided.iter().filter(|decided| decided.decision == decided.class);
        PartFigures {
            name: part.name.clone(),
            trials: count(part.decided.len()),
            right: count(right.count()),
        }
    });
    ClassifierFigures {
        accuracy: rounded(f64::from(right) / f64::from(trials)),
        accuracy_95: wilson(right, trials).map(rounded),
        auc: rounded(auc(parts, classes, |decided| &decided.scores)),
        auc_float: rounded(auc(parts, classes, |decided| &decided.float_scores)),
        parts: parts_figures.collect(),
        confusion,
    }
}

fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

fn rounded(figure: f64) -> f64 {
    (figure * 1e6).round() / 1e6
}

/// Returns the 95 % confidence interval of a probability (Wilson 1927).
fn wilson(right: u32, trials: u32) -> [f64; 2] {
    let n = f64::from(trials);
    let p = f64::from(right) / n;
    let centre = p + Z95.powi(2) / (2.0 * n);
    let width = Z95 * (p * (1.0 - p) / n + (Z95 / (2.0 * n)).powi(2)).sqrt();
    [centre - width, centre + width].map(|end| end / (1.0 + Z95.powi(2) / n))
}

/// Returns the area under the ROC curve, averaged over all pairs of classes. For two classes, it is
/// the fraction of pairs of trials, one trial of each class and both from the same part, that are
/// ordered correctly by the difference between the two classes' scores. 0.5 if no two trials can be
/// compared.
fn auc(parts: &[Part], classes: usize, scores: impl Fn(&Decided) -> &Vec<f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for a in 0..classes {
        for b in 0..a {
            let (mut right, mut pairs) = (0.0, 0.0);
            for part in parts {
                let of = |class: usize| {
                    let own = part.decided.iter().filter(move |decided| decided.class == class);
                    own.map(|decided| scores(decided)[a] - scores(decided)[b]).collect::<Vec<_>>()
                };
                let others = of(b);
                for own in of(a) {
                    for other in &others {
                        right += if own > *other {
                            1.0
                        } else if own < *other {
                            0.0
                        } else {
                            0.5
                        };
                        pairs += 1.0;
                    }
                }
            }
            if pairs > 0.0 {
                sum += right / pairs;
                count += 1.0;
            }
        }
    }
    if count > 0.0 { sum / count } else { 0.5 }
}

/// Returns the accuracy of random guesses that name each class as often as the classifier does.
pub(crate) fn chance(figures: &ClassifierFigures) -> f64 {
    let rows = figures.confusion.iter();
    let trials: u32 = rows.clone().flatten().sum();
    let part = |class: usize| {
        let row: u32 = figures.confusion[class].iter().sum();
        let column: u32 = figures.confusion.iter().map(|row| row[class]).sum();
        f64::from(row) * f64::from(column) / f64::from(trials).powi(2)
    };
    (0..rows.len()).map(part).sum()
}

/// Formats a fraction as a percentage, without the percent sign.
pub(crate) fn percent(part: f64) -> String {
    format!("{:.1}", 100.0 * part)
}

/// Writes figures as a table. `labels` are the events of the classes.
pub(super) fn write(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    labels: &[&str],
    figures: &ClassifierFigures,
) -> fmt::Result {
    let [low, high] = figures.accuracy_95.map(percent);
    writeln!(f, "\n{title}:")?;
    for PartFigures { name, trials, right } in &figures.parts {
        writeln!(f, "  {name:<24} {right:>4} of {trials} right")?;
    }
    writeln!(
        f,
        "  accuracy {} % (95 % interval {low} to {high} %), AUC {} % ({} % without quantisation)",
        percent(figures.accuracy),
        percent(figures.auc),
        percent(figures.auc_float)
    )?;
    write!(f, "  {:<12}", "true")?;
    for label in labels {
        write!(f, " {label:>10}")?;
    }
    writeln!(f, " {:>8}", "right")?;
    for (class, (label, row)) in labels.iter().zip(&figures.confusion).enumerate() {
        write!(f, "  {label:<12}")?;
        for decided in row {
            write!(f, " {decided:>10}")?;
        }
        let trials: u32 = row.iter().sum();
        let right = f64::from(row[class]) / f64::from(trials.max(1));
        writeln!(f, " {:>6} %", percent(right))?;
    }
    if figures.accuracy_95[0] <= chance(figures) {
        writeln!(
            f,
            "  warning: this is not better than guessing, which is right in {} %; use more trials, \
             or another band or part of the trial",
            percent(chance(figures))
        )?;
    }
    Ok(())
}
