//! The formatter of `man` accepts the manual pages of `corticode-bridge` without a warning.

use std::path::Path;
use std::process::Command;

use acceptance::programs::programs;
use emulator::skip::skip_unless_required;

#[test]
fn groff_formats_every_page_without_a_warning() {
    if !Path::new("/usr/bin/groff").exists() {
        let why = "no groff in /usr/bin; `apt-get install groff-base`";
        return skip_unless_required("manual pages", why);
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut bridge = Command::new(&programs().bridge);
    bridge.args(["man", "--folder"]).arg(folder.path());
    assert!(bridge.status().expect("the bridge starts").success());
    let pages = folder.path().read_dir().expect("the folder");
    let mut count = 0;
    for page in pages {
        let page = page.expect("a page").path();
        let mut groff = Command::new("/usr/bin/groff");
        groff.args(["-ww", "-man", "-Tutf8"]).arg(&page);
        let output = groff.output().expect("groff starts");
        let warnings = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{page:?}: {warnings}");
        assert!(warnings.is_empty(), "{page:?}: {warnings}");
        let text = String::from_utf8_lossy(&output.stdout);
        // The footer of each formatted page contains the name of the manual.
        assert!(text.contains("Corticode"), "{page:?}: {text}");
        count += 1;
    }
    assert!(count > 5, "only {count} pages");
}
