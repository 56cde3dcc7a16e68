//! Statuses for `/diagnostics` from the reports of the device and of the decoder.

pub(crate) mod audit;
pub(crate) mod converters;
pub(crate) mod packed;

use link::{ElectrodeQuality, Quality, StageTiming, Timing};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

/// Returns the status `timing`. The message names the processing stages that missed a deadline
/// since the device started, and the stack if more than 3/4 of it was used. The values of the
/// status are the times of all stages.
pub(crate) fn timing_status(timing: &Timing) -> DiagnosticStatus {
    let Timing { stages, stack_used, stack_size } = timing;
    let late = stages.iter().filter(|stage| is_late(stage));
    let late: Vec<String> = late.map(|stage| stage.stage.to_string()).collect();
    let stack = format!("{stack_used} of {stack_size} bytes");
    let stack_is_short = *stack_size > 0 && 4 * u64::from(*stack_used) > 3 * u64::from(*stack_size);
    let warnings: Vec<String> = [
        (!late.is_empty()).then(|| format!("late since boot: {}", late.join(" "))),
        stack_is_short.then(|| format!("stack nearly used up: {stack}")),
    ]
    .into_iter()
    .flatten()
    .collect();
    let state = if warnings.is_empty() {
        let message = format!("{} stages within their deadlines", stages.len());
        (DiagnosticLevel::Ok, message)
    } else {
        (DiagnosticLevel::Warn, warnings.join("; "))
    };
    let mut values: Vec<KeyValue> = stages.iter().flat_map(stage_figures).collect();
    if *stack_size > 0 {
        values.push(KeyValue::new("stack", &stack));
    }
    DiagnosticStatus::new("timing", state, values)
}

/// Returns the processing stage with the largest ratio of worst time to deadline.
pub(crate) fn closest_to_deadline<'t>(
    stages: impl Iterator<Item = &'t StageTiming>,
) -> Option<StageTiming> {
    // Compare products instead of quotients: a/b > c/d if a*d > c*b.
    let product = |worst: &StageTiming, deadline: &StageTiming| {
        u64::from(worst.worst_ns) * u64::from(deadline.deadline_ns)
    };
    stages.max_by(|one, other| product(one, other).cmp(&product(other, one))).copied()
}

/// Formats a stage's worst time with its deadline, such as "worst 122.5 us of 1953 us".
pub(crate) fn worst_of_deadline(stage: &StageTiming) -> String {
    format!(
        "worst {} us of {} us",
        f64::from(stage.worst_ns) / 1000.0,
        f64::from(stage.deadline_ns) / 1000.0
    )
}

fn is_late(stage: &StageTiming) -> bool {
    stage.worst_ns > stage.deadline_ns
}

fn stage_figures(stage: &StageTiming) -> [KeyValue; 2] {
    let name = stage.stage;
    let [within @ .., late] = stage.histogram;
    let within = within.map(|count| count.to_string()).join(" ");
    let times = format!("{within}, late {late}");
    [
        KeyValue::new(&name.to_string(), &worst_of_deadline(stage)),
        KeyValue::new(&format!("{name}: times per eighth of it"), &times),
    ]
}

/// Mains voltage at an electrode's input above which the status names the electrode, microvolt RMS.
///
/// The mains frequency of continental Europe stays within 50 mHz of 50 Hz (Regulation (EU)
/// 2017/1485, annex III, standard frequency range). At a deviation `df` of 50 mHz, a notch filter
/// of Q 30 passes the fraction `2 Q df / f` = 6 % of the mains voltage. Of 100 uV, 6 uV remain:
/// about one level of the encoder's int8 input (5.1 uV).
const MAINS_LIMIT_UV: f32 = 100.0;

/// Returns the status `signal quality`. The message names electrodes with faults; the values of the
/// status are the measurements at all electrodes.
pub(crate) fn signal_quality_status(quality: &Quality, labels: &[String]) -> DiagnosticStatus {
    let label = |index: usize| {
        let label = labels.get(index).cloned();
        label.unwrap_or_else(|| format!("electrode {index}"))
    };
    let electrodes: Vec<(String, &ElectrodeQuality)> =
        (0..).map(label).zip(&quality.electrodes).collect();
    let with = |fault: &str, has: fn(&ElectrodeQuality) -> bool| {
        let named = electrodes.iter().filter(|(_, electrode)| has(electrode));
        let named: Vec<&str> = named.map(|(label, _)| label.as_str()).collect();
        (!named.is_empty()).then(|| format!("{fault}: {}", named.join(" ")))
    };
    let mains = format!("mains above {MAINS_LIMIT_UV} uV");
    let faults: Vec<String> = [
        with("flat", |electrode| electrode.flat),
        with("at the rail", |electrode| electrode.samples_at_rail > 0),
        with(&mains, |electrode| electrode.mains_uv > MAINS_LIMIT_UV),
    ]
    .into_iter()
    .flatten()
    .collect();
    let state = if !faults.is_empty() {
        (DiagnosticLevel::Warn, faults.join("; "))
    } else if quality.settling {
        (DiagnosticLevel::Ok, "the filters are settling".to_owned())
    } else {
        let message = format!("{} electrodes in order", electrodes.len());
        (DiagnosticLevel::Ok, message)
    };
    let values = electrodes
        .iter()
        .map(|(label, electrode)| KeyValue::new(label, &electrode_figures(electrode)))
        .collect();
    DiagnosticStatus::new("signal quality", state, values)
}

fn electrode_figures(electrode: &ElectrodeQuality) -> String {
    let ElectrodeQuality { rms_uv, mains_uv, mains_residual_uv, samples_at_rail, flat } = electrode;
    let rail = match samples_at_rail {
        0 => String::new(),
        samples => format!(", {samples} samples at the rail"),
    };
    let flat = if *flat { ", flat" } else { "" };
    format!(
        "rms {rms_uv:.1} uV, mains {mains_uv:.1} uV, {mains_residual_uv:.2} uV after the \
         filters{rail}{flat}"
    )
}

/// Shortest time between two log messages about a bad link, microseconds.
const PERIOD_US: i64 = 60_000_000;

/// Numbers of damaged frames and of missing codes, packed blocks, samples and events since the last
/// log message about a bad link.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LinkLog {
    /// Host time of the last log message about a bad link, microseconds; `None` before the first.
    logged_us: Option<i64>,
    damaged: u64,
    /// Number of codes, blocks, samples and events missing within runs of the device.
    lost: u64,
    /// Number of codes, blocks and samples missing between two runs, because the device restarted.
    between_runs: u64,
    /// Total of `between_runs` so far; a log message does not reset it.
    all_between_runs: u64,
}

impl LinkLog {
    pub(crate) fn add_damaged(&mut self, frames: u32) {
        self.damaged = self.damaged.saturating_add(frames.into());
    }

    /// Adds `missing` items. `all_between_runs` is the running total of items missing between two
    /// runs of the device, including any in `missing`.
    pub(crate) fn add_missing(&mut self, missing: u64, all_between_runs: u64) {
        let between_runs = all_between_runs.saturating_sub(self.all_between_runs);
        self.all_between_runs = all_between_runs;
        self.between_runs = self.between_runs.saturating_add(between_runs);
        let within = missing.saturating_sub(between_runs);
        self.lost = self.lost.saturating_add(within);
    }

    /// Returns the log message about a bad link if there are new losses or damaged frames and a
    /// message is due at `now_us`. Then sets all counts but the total to 0.
    pub(crate) fn next_line(&mut self, now_us: i64) -> Option<String> {
        let is_over = |last_us| now_us - last_us >= PERIOD_US;
        let is_due = self.logged_us.is_none_or(is_over);
        let LinkLog { damaged, lost, between_runs, all_between_runs, .. } = *self;
        if !is_due || (damaged, lost, between_runs) == (0, 0, 0) {
            return None;
        }
        *self = LinkLog { logged_us: Some(now_us), all_between_runs, ..LinkLog::default() };
        let away = format!(
            "{between_runs} codes, blocks or samples are missing between two runs of the device"
        );
        if (damaged, lost) == (0, 0) {
            return Some(away);
        }
        let away = if between_runs > 0 { format!("; {away}") } else { String::new() };
        Some(format!(
            "bad link: {damaged} frames damaged, {lost} codes, blocks, samples or events missing since \
             the last such line; check cable, connectors and --baud{away}"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::{LinkLog, PERIOD_US};

    #[test]
    fn a_minute_of_losses_is_one_line_with_their_sum() {
        let mut log = LinkLog::default();
        assert_eq!(log.next_line(0), None);
        log.add_damaged(3);
        let line = log.next_line(5).unwrap();
        assert!(line.contains("3 frames damaged, 0 codes"), "{line}");
        for second in 1..60 {
            log.add_missing(2, 0);
            assert_eq!(log.next_line(second * 1_000_000), None);
        }
        let line = log.next_line(PERIOD_US + 5).unwrap();
        assert!(line.contains("0 frames damaged, 118 codes"), "{line}");
        assert_eq!(log.next_line(3 * PERIOD_US), None);
    }

    #[test]
    fn what_is_missing_between_runs_is_no_bad_link() {
        let mut log = LinkLog::default();
        log.add_missing(20, 20);
        let line = log.next_line(0).unwrap();
        assert_eq!(line, "20 codes, blocks or samples are missing between two runs of the device");
        log.add_missing(5, 22);
        let line = log.next_line(PERIOD_US).unwrap();
        assert!(line.contains("0 frames damaged, 3 codes"), "{line}");
        assert!(
            line.ends_with(
                "; 2 codes, blocks or samples are missing between two runs of the device"
            )
        );
    }
}
