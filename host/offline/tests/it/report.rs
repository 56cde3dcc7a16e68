//! The report has a page, a table and the pictures of each recording.

use std::fs;

use new_file::Existing;
use offline::report::{self, Entry};
use offline::{Model, SignalFormat};

use crate::recording::{Fixture, labels};

#[test]
fn a_report_names_every_recording_and_electrode() {
    let fixture = Fixture::settled();
    fixture.encode();
    let compared = fixture.decode(&fixture.codes(), "a.gdf", SignalFormat::Gdf, true);
    let alone = fixture.decode(&fixture.codes(), "b.gdf", SignalFormat::Gdf, false);
    let entries = [("S1/a <1>", compared), ("b", alone)]
        .map(|(name, decoded)| Entry { name: name.to_owned(), decoded: decoded.expect("decoded") });
    let model = Model::embedded().expect("a model");
    let folder = fixture.path("report");
    report::check(&folder, Existing::Refuse).expect("a new folder");
    report::write(&folder, &model.description, &entries).expect("a report");
    assert!(report::check(&folder, Existing::Refuse).is_err());
    report::check(&folder, Existing::Replace).expect("a report to replace");
    let page = fs::read_to_string(folder.join("index.html")).expect("a page");
    assert!(page.contains("S1/a &lt;1&gt;") && page.contains("src=\"S1/a%20&lt;1&gt;/scalp.svg\""));
    assert!(page.contains("no original to compare with"));
    let numbers = model.description.code.numbers;
    assert!(page.contains(&format!(" codes of {numbers} numbers")));
    for (folder_of, files) in
        [("S1/a <1>", &["traces.svg", "scalp.svg", "levels.svg"][..]), ("b", &["levels.svg"][..])]
    {
        for file in files {
            let text = fs::read_to_string(folder.join(folder_of).join(file)).expect("a picture");
            assert!(text.trim_end().ends_with("</svg>"), "{file}");
        }
    }
    assert!(!folder.join("b/scalp.svg").exists());
    let table = fs::read_to_string(folder.join("electrodes.csv")).expect("a table");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 1 + labels().len());
    let comparison = entries[0].decoded.comparison.as_ref().expect("a comparison");
    let prd = comparison.electrodes[0].prd_percent();
    assert!(lines[1].starts_with(&format!("S1/a <1>,{},measured,", labels()[0])));
    assert!(lines[1].ends_with(&format!(",{prd}")), "{}", lines[1]);
}
