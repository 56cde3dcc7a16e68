//! The commands in the README's example of a CI job run exactly as they are printed there.

use std::fs;
use std::process::Command;

use acceptance::workspace;

#[test]
fn the_job_for_ci_counts_the_codes_of_ten_seconds() {
    let page = fs::read_to_string(workspace::root().join("README.md")).expect("the page");
    let (_, job) = page.split_once("```sh\n").expect("the job");
    let (job, _) = job.split_once("```").expect("its end");
    let output = Command::new("bash")
        .args(["-c", job])
        .current_dir(workspace::root())
        .output()
        .expect("bash");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{log}");
    assert_eq!(String::from_utf8_lossy(&output.stdout), "159 codes of 128 numbers\n", "{log}");
}
