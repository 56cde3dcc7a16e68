//! What the demo shows while it runs.

use indicatif::{ProgressBar, ProgressStyle};

use super::run::Run;

/// Components of the code that fit beside the counts on a line of 80.
const SHOWN: usize = 24;
/// Codes per line where there is no terminal to draw a bar on: one line in 5 s.
const LINE_EVERY: usize = 80;

/// A bar with the counts and the latest code.
#[derive(Debug)]
pub(crate) struct Live {
    bar: ProgressBar,
}

impl Live {
    /// A bar for so many codes.
    pub(crate) fn new(codes: u64) -> Self {
        let bar = ProgressBar::new(codes);
        // A template that is wrong leaves the default one.
        if let Ok(style) = ProgressStyle::with_template("{elapsed_precise} {bar:16} {msg}") {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// Says what is being waited for.
    pub(crate) fn waiting(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// Shows the latest code.
    pub(crate) fn heard(&self, run: &Run) {
        let Some(heard) = run.codes.last() else {
            return;
        };
        let fillers = run.codes.len() - run.received();
        let counts = format!("frame {:4}  lost {fillers}", heard.frame.neuroheader.seq);
        self.bar
            .set_position(u64::try_from(run.codes.len()).unwrap_or(u64::MAX));
        self.bar
            .set_message(format!("{counts}  {}", blocks(&heard.frame.eeg.data)));
        if self.bar.is_hidden() && run.codes.len().is_multiple_of(LINE_EVERY) {
            eprintln!("{counts}");
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// The first components as blocks of eight heights, scaled to the largest.
fn blocks(code: &[f32]) -> String {
    const HEIGHTS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let shown = &code[..code.len().min(SHOWN)];
    let largest = shown
        .iter()
        .map(|x| x.abs())
        .fold(f32::MIN_POSITIVE, f32::max);
    let height = |x: &f32| {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "0..=7: x / largest lies within -1..=1; NaN becomes 0"
        )]
        let height = ((x / largest + 1.0) * 3.5).round() as usize;
        HEIGHTS[height.min(7)]
    };
    shown.iter().map(height).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_rise_with_the_value() {
        assert_eq!(blocks(&[-2.0, 0.0, 2.0]), "▁▅█");
        assert_eq!(blocks(&[f32::NAN, 1.0]), "▁█");
        assert_eq!(blocks(&[]), "");
    }
}
