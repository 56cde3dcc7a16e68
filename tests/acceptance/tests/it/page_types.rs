//! TypeScript's compiler accepts the types in the comments of the live page's scripts.

use std::fs;
use std::path::Path;
use std::process::Command;

use acceptance::workspace;
use emulator::skip::skip_unless_required;

/// Options of TypeScript's compiler: check JavaScript strictly, write nothing.
const OPTIONS: [&str; 13] = [
    "--noEmit",
    "--allowJs",
    "--checkJs",
    "--strict",
    "--noImplicitReturns",
    "--noFallthroughCasesInSwitch",
    "--target",
    "es2022",
    "--module",
    "es2022",
    "--lib",
    "es2022,dom,dom.iterable",
    "--pretty",
];

/// Returns the compiler's errors in the scripts in `folder`; an empty text if it finds none.
fn mistakes(folder: &Path) -> String {
    let mut tsc = Command::new("tsc");
    tsc.args(OPTIONS).arg("false").arg("main.js");
    let output = tsc.current_dir(folder).output().expect("tsc starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.success(), said.is_empty(), "{said}");
    said
}

#[test]
fn the_types_of_the_page_are_right_and_a_wrong_one_is_found() {
    if Command::new("tsc").arg("--version").output().is_err() {
        let why = "no tsc; `cargo xtask install` installs node-typescript";
        skip_unless_required("the types of the live page", why);
        return;
    }
    let page = workspace::root().join("host/view/page");
    assert_eq!(mistakes(&page), "");

    let folder = tempfile::tempdir().expect("a folder");
    let mut scripts = 0;
    for entry in fs::read_dir(&page).expect("the page").flatten() {
        let name = entry.file_name();
        if Path::new(&name).extension().is_some_and(|end| end == "js") {
            let text = fs::read_to_string(entry.path()).expect("a script");
            assert!(text.starts_with("// @ts-check\n"), "{name:?}");
            let wrong = "let scripts = 0;\nscripts = 'text';\n";
            let text = format!("{text}export {{}};\n{wrong}");
            fs::write(folder.path().join(name), text).expect("a copy");
            scripts += 1;
        }
    }
    let said = mistakes(folder.path());
    let found = said.matches("error TS2322").count();
    assert_eq!(found, scripts, "one mistake in each script: {said}");
}
