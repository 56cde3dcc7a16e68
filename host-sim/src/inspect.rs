//! The command `host-sim inspect`, which shows what a recording holds and how it fits the montage.

use std::{error::Error, path::Path};

use recordings::{Missing, MontageMap, Recording};

pub(crate) fn inspect(file: &Path) -> Result<(), Box<dyn Error>> {
    let mut recording = Recording::open(file)?;
    println!("{}: {}", file.display(), recording.format());
    println!(
        "{:.3} s in {} records",
        recording.duration_s(),
        recording.records()
    );
    println!("\n{:<18} {:>10}  unit", "signal", "rate");
    for signal in recording.signals() {
        let rate = signal
            .rate
            .map_or_else(|| "-".to_owned(), |r| format!("{:.2} Hz", r.value()));
        println!("{:<18} {rate:>10}  {}", signal.label, signal.unit);
    }
    let events = recording.events()?;
    println!("\n{} events", events.len());
    for event in &events {
        println!("{:>12.3} s  {}", event.onset_s, event.label);
    }
    for warning in recording.warnings() {
        println!("warning: {warning}");
    }
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate)?;
    println!("\n{map}");
    for warning in map.warnings() {
        println!("warning: {warning}");
    }
    Ok(())
}
