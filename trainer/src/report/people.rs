//! Part of a report: error for each person, with the substitution of bad electrodes on and off.

use super::Report;
use super::evaluation::{cells, places};
use crate::error::TrainerError;
use crate::person_error::PersonError;
use picture::page::csv_field;
use picture::scalp_map::{Place, ScalpMap};
use std::fmt::Write as _;

/// Adds the error for each person to a report, and for each person with bad electrodes a picture of
/// the effect of these electrodes on the others.
pub(super) fn add(report: &mut Report, people: &[PersonError]) -> Result<(), TrainerError> {
    report.page.push_text(
        "Error for each person with integer codes: with the electrodes that are bad in a recording \
         filled from the others, as a device fills electrodes that it excludes, and as recorded.",
    );
    let head = [
        "person",
        "bad electrodes",
        "PRD, filled",
        "as recorded",
        "MSE of the good electrodes, uV²: others filled",
        "as recorded",
    ];
    let rows = people.iter().map(|error| {
        let [good_on, good_off] = error.of_good();
        vec![
            error.person.subject.clone(),
            error.person.bad.join(", "),
            format!("{:.2} %", error.on.all.prd_percent),
            format!("{:.2} %", error.off.all.prd_percent),
            format!("{good_on:.2}"),
            format!("{good_off:.2}"),
        ]
    });
    let head = head.map(str::to_owned).to_vec();
    let table: Vec<Vec<String>> = std::iter::once(head).chain(rows).collect();
    report.page.push_table(&table);
    report.write("people.csv", &csv(people))?;
    for error in people.iter().filter(|error| !error.person.bad.is_empty()) {
        let subject = &error.person.subject;
        let map = scalp_map(error);
        report.add_picture(
            &format!("substitution-{subject}"),
            |path| map.draw(path),
            &format!(
                "{subject}: how many times as large the error of each good electrode is without the \
                 substitution of the bad ones, {}, which are left out.",
                error.person.bad.join(", ")
            ),
            &csv(std::slice::from_ref(error)),
        )?;
    }
    Ok(())
}

fn scalp_map(error: &PersonError) -> ScalpMap {
    let [on, off] = error.of_good();
    let places = places(cells(&error.on.electrodes));
    let electrodes = error.on.electrodes.iter().zip(error.of_electrodes());
    // Leave out the bad electrodes: their errors are so large that the others could not be told
    // apart.
    let good = electrodes
        .zip(places)
        .filter(|((electrode, _), _)| !error.person.bad.contains(&electrode.label));
    let places = good.map(|((electrode, (label, [on, off])), at)| Place {
        label: label.to_owned(),
        at,
        value: off / on,
        is_measured: electrode.is_recorded,
    });
    ScalpMap {
        places: places.collect(),
        title: format!("{}: error without substitution over with", error.person.subject),
        subtitle: format!("mean over the good electrodes: {off:.2} µV² over {on:.2} µV²"),
        unit: "times".to_owned(),
    }
}

fn csv(people: &[PersonError]) -> String {
    let mut text = "subject,electrode,is_bad,mse_uv2_on,mse_uv2_off\n".to_owned();
    for error in people {
        for (label, [on, off]) in error.of_electrodes() {
            let (subject, is_bad) =
                (csv_field(&error.person.subject), error.person.bad.iter().any(|bad| bad == label));
            let label = csv_field(label);
            let _ = writeln!(text, "{subject},{label},{is_bad},{on},{off}");
        }
    }
    text
}
