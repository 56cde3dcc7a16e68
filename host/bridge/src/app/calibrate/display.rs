//! What the user sees while the program listens: progress, and the quality of each electrode.

use artifact::Description;
use indicatif::{ProgressBar, ProgressStyle};
use packed_fit::GoodSignal;

use crate::app::calibrate::listening::Listening;

/// Number of seconds between two lines in the log if there is no terminal.
const LOG_INTERVAL: usize = 10;

/// A progress bar, and below it the scalp grid with the RMS of each electrode. Without a terminal,
/// a line in the log every ten seconds.
pub(crate) struct Display {
    bar: ProgressBar,
    /// Rows of the scalp grid, each with the electrodes' labels and indices; `None` where there is
    /// no electrode.
    rows: Vec<Vec<Option<(String, usize)>>>,
    labels: Vec<String>,
    wanted: usize,
    /// Number of calls of [`Self::show`].
    shown: usize,
}

impl Display {
    pub(crate) fn new(description: &Description, wanted: usize) -> Display {
        let labels = description.montage.electrodes.clone();
        let cell = |label: &String| {
            let index = labels.iter().position(|known| known == label)?;
            Some((label.clone(), index))
        };
        let rows = description.grid.cells.iter();
        let rows = rows.map(|row| row.iter().map(cell).collect()).collect();
        let style = ProgressStyle::with_template("{bar:40} {pos} of {len} s of good signal{msg}");
        let bar = ProgressBar::new(wanted as u64);
        bar.set_style(style.expect("the template is correct"));
        Display { bar, rows, labels, wanted, shown: 0 }
    }

    /// Shows the good signal so far, the newest second of each electrode, and the faults of
    /// electrodes that the device reports; called every second.
    pub(crate) fn show(
        &mut self,
        signal: &GoodSignal,
        listening: &Listening,
        faults: Option<&str>,
    ) {
        self.shown += 1;
        if listening.steps == 0 {
            return;
        }
        let rms = listening.newest_rms_uv();
        let bad: Vec<&str> = (0..self.labels.len())
            .filter(|&at| signal.newest_bad.get(at) == Some(&true))
            .map(|at| self.labels[at].as_str())
            .collect();
        let mut bad =
            if bad.is_empty() { String::new() } else { format!("; bad now: {}", bad.join(" ")) };
        if let Some(faults) = faults {
            bad.push_str("; the device finds ");
            bad.push_str(faults);
        }
        bad.push_str(&listening.unusable_words());
        if self.bar.is_hidden() && self.shown.is_multiple_of(LOG_INTERVAL) {
            let (good, wanted) = (signal.seconds(), self.wanted);
            tracing::info!("{good} of {wanted} s of good signal{bad}");
        }
        let mut text = bad;
        let cell = |cell: &Option<(String, usize)>| {
            let Some((label, at)) = cell else {
                return " ".repeat(8);
            };
            let mark = if signal.newest_bad.get(*at) == Some(&true) { '!' } else { ' ' };
            let rms = rms.get(*at).copied().unwrap_or_default();
            format!("{mark}{label:>3}{rms:>4.0}")
        };
        for row in &self.rows {
            if row.iter().any(Option::is_some) {
                let cells: Vec<String> = row.iter().map(cell).collect();
                text.push('\n');
                text.push_str(cells.join(" ").trim_end());
            }
        }
        text.push_str("\nRMS of each electrode, uV; ! bad in this second");
        self.bar.set_position(signal.seconds() as u64);
        self.bar.set_message(text);
    }

    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
