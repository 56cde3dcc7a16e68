//! `host-sim inspect`: the times of events, and the exit status for files that `run` refuses.

use std::{fs, path::Path, process::Stdio};

use crate::edf_file::EdfFile;
use crate::program::{program, run};

/// Runs `inspect` on a file. Returns exit status, standard output and standard error.
fn inspect(path: &Path) -> (Option<i32>, String, String) {
    let mut command = program(&["inspect".as_ref(), path.as_os_str()]);
    let output = command.stdout(Stdio::piped()).output().expect("it runs");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn an_event_has_the_time_since_the_first_sample_and_that_of_the_file_if_it_differs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.edf");
    // The EDF+C file starts at 0.640625 s; the EDF+D file has a gap before its last record.
    let start: [&[u8]; 3] = [
        b"+0.640625\x14\x14\0+0.890625\x14first\x14\0",
        b"+1.640625\x14\x14\0+1.890625\x14second\x14\0",
        b"+2.640625\x14\x14\0+9.5\x14late\x14\0",
    ];
    let gap: [&[u8]; 3] = [
        b"+0\x14\x14\0+0.25\x14first\x14\0",
        b"+1\x14\x14\0+1.25\x14second\x14\0",
        b"+10\x14\x14\0+10.5\x14third\x14\0",
    ];
    for (variant, lists, expected) in [
        (
            b"EDF+C",
            start,
            [
                "       0.250 s  first (0.891 s by the file's clock)\n",
                "       1.250 s  second (1.891 s by the file's clock)\n",
                "     outside    late (9.500 s by the file's clock)\n2 events are played\n",
            ],
        ),
        (
            b"EDF+D",
            gap,
            [
                "       0.250 s  first\n",
                "       1.250 s  second\n",
                "       2.500 s  third (10.500 s by the file's clock)\n",
            ],
        ),
    ] {
        let mut file = EdfFile::with_all_electrodes(3);
        file.annotations = lists.to_vec();
        let mut bytes = file.bytes();
        bytes[192..197].copy_from_slice(variant);
        fs::write(&path, bytes).expect("writable");
        let (status, text, log) = inspect(&path);
        assert_eq!((status, &*log), (Some(0), ""), "{text}");
        for line in expected {
            assert!(text.contains(line), "no {line:?} in {text}");
        }
    }
}

#[test]
fn what_a_run_refuses_has_its_table_and_the_status_and_message_of_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("none.edf");
    let mut file = EdfFile::with_all_electrodes(2);
    file.signals[2].samples_per_record = 0;
    fs::write(&path, file.bytes()).expect("writable");
    let (status, text, log) = inspect(&path);
    assert!(text.contains("128.00 Hz  uV"), "{text}");
    let input = format!("--input={}", path.display());
    let refused = run(&["run", &input, "--output=file:/dev/null"]);
    assert_eq!((status, &log), (refused.status, &refused.log));
    assert_eq!(status, Some(2));
}
