//! Writes the page of a report.

use artifact::Description;
use picture::page::{Page, escaped, href, image};

use super::{Entry, pictures};
use crate::comparison::{Comparison, settling_s};
use crate::decoding::Decoded;

/// Returns the page as HTML. Its pictures are files in folders next to it.
pub(super) fn page(description: &Description, entries: &[Entry]) -> String {
    let rows: String = entries.iter().map(|entry| summary(description, entry)).collect();
    let sections: String = entries.iter().map(|entry| section(description, entry)).collect();
    let size = format!(
        "{} electrodes, {} Hz, one code or packed block every {} ms",
        description.montage.electrodes.len(),
        description.window.rate_hz,
        1_000.0 * code_interval_s(description)
    );
    let mut page = Page::new("Decoded EEG");
    page.push_html(&format!(
        "<p>{size}. Reference: the recording \
         after notch, band-pass and resampling, before it becomes the input of an encoder. Steps in which the filters settle, and \
         steps without a code or block, are left out; so are those of an electrode that the device excluded and filled from the others. RMS is that of the reference; PRD = 100 sqrt(sum of squared difference / sum of squared \
         reference). MSE is in units of the network's input ({:.2} uV) squared. The numbers of all electrodes: \
         <a href=\"electrodes.csv\">electrodes.csv</a>.</p>\n<table><tr><th>recording</th><th>seconds</th>\
         <th>decoded from</th><th>missing</th><th>RMS, uV</th><th>PRD, all</th><th>PRD, measured</th><th>MSE</th><th>MSE, uV&sup2;</th>\
         </tr>\n{rows}</table>\n{sections}",
        description.input.sd_uv
    ));
    page.to_html()
}

/// Returns the time from one code to the next, seconds.
fn code_interval_s(description: &Description) -> f64 {
    let hop = u32::try_from(description.window.hop).unwrap_or(u32::MAX);
    f64::from(hop) / f64::from(description.window.rate_hz)
}

fn summary(description: &Description, entry: &Entry) -> String {
    let decoded = &entry.decoded;
    let name = escaped(&entry.name);
    let errors = match entry.compared() {
        Some(comparison) => {
            let total = comparison.total();
            let mse_uv2 = total.mse_uv2();
            format!(
                "<td>{:.2}</td><td>{:.2} %</td><td>{:.2} %</td><td>{:.5}</td><td>{mse_uv2:.2}</td>",
                comparison.rms_uv(),
                total.prd_percent(),
                comparison.total_measured().prd_percent(),
                mse_uv2 / description.input.sd_uv.powi(2)
            )
        }
        None if decoded.comparison.is_some() => {
            format!(
                "<td colspan=\"5\">too short to compare: the filters settle for {} s</td>",
                settling_s()
            )
        }
        None => "<td colspan=\"5\">no original to compare with</td>".to_owned(),
    };
    format!(
        "<tr><td><a href=\"#{}\">{name}</a></td><td>{:.1}</td><td>{}</td><td>{}</td>{errors}</tr>\n",
        href(&entry.name),
        decoded.signal_s(),
        items(description, decoded),
        decoded.missing
    )
}

/// Returns a text with the number of codes or packed blocks and their size.
fn items(description: &Description, decoded: &Decoded) -> String {
    match decoded.bits_per_block() {
        Some(bits) => format!("{} packed blocks of {bits:.1} bits", decoded.codes),
        None => format!("{} codes of {} numbers", decoded.codes, description.code.numbers),
    }
}

fn section(description: &Description, entry: &Entry) -> String {
    let name = escaped(&entry.name);
    let picture = |file: &str, what: &str| image(&format!("{}/{file}", entry.name), what) + "\n";
    let compared = entry.compared().map(|comparison| {
        let mut text = picture(pictures::TRACES, "original and decoded signal");
        text += &picture(pictures::SCALP, "error of each electrode on the scalp");
        text += &electrodes(description, comparison);
        text
    });
    let levels = if entry.decoded.is_packed() {
        String::new()
    } else {
        picture(pictures::LEVELS, "histogram of the codes' levels")
    };
    let compared = compared.unwrap_or_default();
    let types = entry.decoded.event_types.iter();
    let types: Vec<String> =
        types.map(|(text, kind)| format!("{kind} {}", escaped(text))).collect();
    let types = if types.is_empty() {
        String::new()
    } else {
        format!("<p>Event types in GDF: {}.</p>\n", types.join(", "))
    };
    format!("<h2 id=\"{name}\">{name}</h2>\n{compared}{levels}{types}")
}

fn electrodes(description: &Description, comparison: &Comparison) -> String {
    let unit = description.input.sd_uv.powi(2);
    let labels = description.montage.electrodes.iter();
    let errors = comparison.electrodes.iter().zip(&comparison.origins);
    let rows = labels.zip(errors).map(|(label, (error, origin))| {
        let mse_uv2 = error.mse_uv2();
        format!(
            "<tr><td>{}</td><td>{origin}</td><td>{:.2} %</td><td>{:.5}</td><td>{mse_uv2:.2}</td><td>{}</td></tr>\n",
            escaped(label),
            error.prd_percent(),
            mse_uv2 / unit,
            comparison.steps - error.steps
        )
    });
    let rows: String = rows.collect();
    format!(
        "<details><summary>all electrodes</summary><table><tr><th>electrode</th><th>origin</th><th>PRD</th>\
         <th>MSE</th><th>MSE, uV&sup2;</th><th>steps left out</th></tr>\n{rows}</table></details>\n"
    )
}
