//! If the reader of standard output or standard error, such as `head`, has closed its pipe, only
//! the output to this pipe ends.

use std::{fs, io, process::Stdio};

use crate::gdf_file::gdf_file;
use crate::program::program;

/// Returns the write end of a pipe whose read end is closed.
fn closed() -> Stdio {
    let (reader, writer) = io::pipe().expect("a pipe");
    drop(reader);
    writer.into()
}

#[test]
fn a_reader_that_has_gone_changes_neither_status_nor_result() {
    let rate = model::ADC_RATE_HZ;
    let file = gdf_file(rate, 2 * rate, &[(5, 0x0301)], |_| vec![f32::NAN; model::ELECTRODES]);
    let folder = tempfile::tempdir().expect("a folder");
    let codes = folder.path().join("a.codes");
    let [file, codes_text] = [file.path(), &codes].map(|path| path.to_str().expect("text"));
    let input = format!("--input={file}");
    for arguments in [
        &["inspect", file][..],
        &["run", "--output=ndjson:-", &input],
        &["encode", file, codes_text],
        &["encode", "/none", "/none.codes"],
    ] {
        let mut command = program(arguments);
        let open = command.stdout(Stdio::null()).output().expect("it runs");
        let _ = fs::remove_file(&codes);
        let mut command = program(arguments);
        let output = command.stdout(closed()).stderr(closed()).output();
        let status = output.expect("it runs").status;
        assert_eq!(status, open.status, "{arguments:?}");
        assert_eq!(codes.exists(), arguments[0] == "encode" && arguments[1] == file);
        let _ = fs::remove_file(&codes);
    }
}

#[test]
fn an_output_that_is_full_has_failed() {
    let full = fs::File::options().write(true).open("/dev/full");
    let file = gdf_file(100, 200, &[], |_| vec![1.0; model::ELECTRODES]);
    let mut command = program(&["inspect".as_ref(), file.path().as_os_str()]);
    let output = command.stdout(full.expect("/dev/full")).output();
    let output = output.expect("it runs");
    assert_eq!(output.status.code(), Some(1));
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(log.contains("standard output cannot be written"), "{log}");
}
