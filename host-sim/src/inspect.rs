//! The command `host-sim inspect`, which shows what a recording holds and how it fits the montage.

use std::{error::Error, fmt::Write as _, path::Path};

use offline::Played;
use recordings::{Missing, Recording};

/// Prints a table of signals and events, then how the recording fits the montage.
///
/// # Errors
/// The error with which `host-sim run` and `host-sim encode` refuse the recording, if they do.
pub(crate) fn inspect(file: &Path) -> Result<(), Box<dyn Error>> {
    let mut recording = Recording::open(file)?;
    let mut text = format!("{}: ", file.display());
    describe(&mut recording, &mut text)?;
    new_file::print(text)?;
    let played = Played::open(file, Missing::Interpolate);
    // If `Played` refuses the recording, the warnings are only in `recording`.
    let warnings = match &played {
        Ok(played) => played.warnings.clone(),
        Err(_) => recording.warnings().iter().map(ToString::to_string).collect(),
    };
    for warning in warnings {
        new_file::print(format_args!("warning: {warning}\n"))?;
    }
    let played = played?;
    let (onsets, montage) = (&played.onsets, &played.montage);
    let events = onsets.seconds.len();
    new_file::print(format_args!("{events} events are played\n\n{montage}\n"))?;
    Ok(())
}

/// Appends format, length, signals and events of a recording to `text`. Each event has its time
/// since the first sample, which every program uses, and also the time that the file states if it
/// differs.
fn describe(recording: &mut Recording, text: &mut String) -> Result<(), Box<dyn Error>> {
    writeln!(text, "{}", recording.format())?;
    let (seconds, records) = (recording.duration_s(), recording.records());
    writeln!(text, "{seconds:.3} s in {records} records\n")?;
    writeln!(text, "{:<18} {:>10}  unit", "signal", "rate")?;
    for signal in recording.signals() {
        let rate = signal.rate.map_or_else(|| "-".to_owned(), |r| format!("{:.2} Hz", r.value()));
        writeln!(text, "{:<18} {rate:>10}  {}", signal.label, signal.unit)?;
    }
    let events = recording.placed_events()?;
    writeln!(text, "\n{} events", events.len())?;
    for (event, place_s) in &events {
        match place_s {
            Some(place_s) => write!(text, "{place_s:>12.3} s  {}", event.label)?,
            None => write!(text, "{:>12}    {}", "outside", event.label)?,
        }
        let differs = place_s.is_none_or(|place_s| (place_s - event.onset_s).abs() > 5e-4);
        if differs {
            write!(text, " ({:.3} s by the file's clock)", event.onset_s)?;
        }
        text.push('\n');
    }
    Ok(())
}
