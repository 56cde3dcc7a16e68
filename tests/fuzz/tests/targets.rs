//! Checks that every target accepts its seeds, and that no target panics for the stored inputs or
//! for thousands of mutations, which are the same in every run.
#![allow(missing_docs, reason = "tests")]

use fuzz::{Outcome, corpus, search, target};

macro_rules! targets {
    ($($name:ident,)*) => {
        $(#[test]
        fn $name() {
            check(stringify!($name));
        })*

        #[test]
        fn every_target_is_searched() {
            let names = fuzz::TARGETS.map(|target| target.name);
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

targets! {
    artifact,
    bdf,
    code_file,
    commands,
    dfu,
    edf,
    frames,
    gdf,
    tcpros,
    uploaded_model,
    view_request,
    wire_recording,
    xmlrpc,
}

fn check(name: &str) {
    let target = target(name);
    for (number, seed) in target.seeds().iter().enumerate() {
        assert_eq!(target.read(seed), Outcome::Accepted, "seed {number} of {name}");
    }
    for input in corpus(name) {
        target.read(&input);
    }
    let searched = search(&target);
    println!("{name}: {searched:?}");
    // If all inputs had the same outcome, the search would not get past the target's first check.
    assert!(searched.accepted > target.inputs / 100, "{searched:?}");
    assert!(searched.refused > 0, "{searched:?}");
}
