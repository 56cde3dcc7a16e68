//! The device's report about its electrodes, for `/diagnostics`.

use link::{ElectrodeQuality, Quality};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::diagnostics::status::new_status;

/// Mains voltage at an electrode's input above which the status names the electrode, microvolt RMS.
///
/// The mains frequency of continental Europe stays within 50 mHz of 50 Hz (Regulation (EU)
/// 2017/1485, annex III, standard frequency range). At a deviation `df` of 50 mHz, a notch filter
/// of Q 30 passes the fraction `2 Q df / f` = 6 % of the mains voltage. Of 100 uV, 6 uV remain:
/// about one level of the encoder's int8 input (5.1 uV).
const MAINS_LIMIT_UV: f32 = 100.0;

/// Returns the status `signal quality`. The message names electrodes with faults; the values are
/// the measurements of all electrodes.
pub(crate) fn signal_quality_status(quality: &Quality, labels: &[String]) -> DiagnosticStatus {
    let electrodes: Vec<(String, &ElectrodeQuality)> = quality
        .electrodes
        .iter()
        .enumerate()
        .map(|(index, electrode)| {
            let label = labels.get(index).cloned();
            let label = label.unwrap_or_else(|| format!("electrode {index}"));
            (label, electrode)
        })
        .collect();
    let with = |fault: &str, has: fn(&ElectrodeQuality) -> bool| {
        let named: Vec<&str> = electrodes
            .iter()
            .filter(|(_, electrode)| has(electrode))
            .map(|(label, _)| label.as_str())
            .collect();
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
        .map(|(label, electrode)| KeyValue::new(label, &figures(electrode)))
        .collect();
    new_status("signal quality", state, values)
}

fn figures(electrode: &ElectrodeQuality) -> String {
    let ElectrodeQuality {
        rms_uv,
        mains_uv,
        mains_residual_uv,
        samples_at_rail,
        flat,
    } = electrode;
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
