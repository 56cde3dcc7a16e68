//! Reports as JUnit XML, which CI systems read.

use std::io;

use quick_xml::Writer;
use quick_xml::events::{BytesText, Event};

use super::report::Report;

/// Returns the reports as JUnit XML: one test case for each scenario.
///
/// # Errors
/// Never in practice: the XML is written to memory.
pub fn junit(reports: &[Report]) -> io::Result<Vec<u8>> {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    let failed = reports.iter().filter(|report| !report.passed()).count();
    let suite = writer.create_element("testsuite").with_attributes([
        ("name", "host-sim scenario"),
        ("tests", &*reports.len().to_string()),
        ("failures", &*failed.to_string()),
    ]);
    suite.write_inner_content(|writer| {
        for report in reports {
            let case = writer
                .create_element("testcase")
                .with_attributes([("classname", "scenario"), ("name", &*report.name)]);
            case.write_inner_content(|writer| {
                if !report.passed() {
                    let failure = writer.create_element("failure");
                    let failure = failure.with_attribute(("message", &*report.failures.join("; ")));
                    failure.write_empty()?;
                }
                let output = writer.create_element("system-out");
                output.write_text_content(BytesText::new(&report.to_string()))?;
                Ok(())
            })?;
        }
        Ok(())
    })?;
    writer.write_event(Event::Eof)?;
    Ok(writer.into_inner())
}
