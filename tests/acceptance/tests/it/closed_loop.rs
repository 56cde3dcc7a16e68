//! `cargo loop`: from recordings with cues to decisions about a recording that the classifier has
//! not seen, with the programs that users start.

use acceptance::programs::{programs, trainer};
use demo::closed_loop::{Options, run};
use pipeline::Mains;

#[test]
fn cues_of_a_held_out_recording_are_decided_as_offline() {
    let Some(trainer) = trainer("closed loop") else {
        return;
    };
    let folder = programs().bridge.parent();
    assert_eq!(folder, trainer.parent(), "all programs are in one folder");
    let options = Options { own: None, mains: Mains::Hz50, seed: 1, fast: true };
    let pictures = tempfile::tempdir().expect("a folder");
    let outcome = run(&options, folder.expect("a folder"), Some(pictures.path()));
    let outcome = outcome.unwrap_or_else(|failure| panic!("{}", failure.message));
    println!("{outcome}");
    // Guesses would be right in 10 or more of 12 trials in one of 52 runs.
    let [right, decided] = outcome.right_and_decided();
    assert!(right >= 10 && decided == 12, "{outcome}");
    assert_eq!([outcome.received.len(), outcome.equal], [640, 640], "{outcome}");
    assert!(pictures.path().join("loop.svg").exists());
}
