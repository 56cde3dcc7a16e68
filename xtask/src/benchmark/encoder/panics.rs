//! Where the firmware's tasks between converter and frames can panic.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::failure::Failure;

/// The one file whose panics may be left in the image: embassy-sync's queue asserts that it is not full
/// when a slot is handed on, and not empty when one is given back. Both tasks do so only with a slot that
/// the queue has given them.
const ALLOWED: &str = "src/zerocopy_channel.rs";

/// The image's sources, by how the places of its panics end.
const SOURCE: &[u8] = b".rs";

/// Checks that an image whose panic handler keeps the places of panics has those of the queue and no
/// others.
///
/// # Errors
/// It has others, or none at all: then the check itself is broken.
pub(super) fn check(path: &Path) -> Result<(), Failure> {
    let failed = |why: String| Failure::Check {
        what: format!("the panics of {}", path.display()),
        why,
        next: "make the condition impossible to the compiler's eyes (`get`, `zip`, NonZero), or \
               handle it; `bench/src/bin/tasks.rs` says what is in the image"
            .to_owned(),
    };
    let image = fs::read(path).map_err(|error| failed(error.to_string()))?;
    let loaded = super::elf::contents(&image)
        .ok_or_else(|| failed("this is no 32-bit ELF file with segments".to_owned()))?;
    judge(&places(&loaded)).map_err(failed)
}

fn judge(places: &BTreeSet<String>) -> Result<(), String> {
    let (allowed, others): (Vec<_>, Vec<_>) = places
        .iter()
        .map(String::as_str)
        .partition(|place| place.ends_with(ALLOWED));
    if !others.is_empty() {
        return Err(format!(
            "acquire or encode can panic in {}",
            others.join(", ")
        ));
    }
    if allowed.is_empty() {
        return Err(format!(
            "not even {ALLOWED} is there: the image does not keep the places of its panics"
        ));
    }
    Ok(())
}

/// The source files that are named in what is loaded.
fn places(loaded: &[u8]) -> BTreeSet<String> {
    let is_of_path = |byte: &u8| byte.is_ascii_graphic();
    let ends = loaded
        .windows(SOURCE.len())
        .enumerate()
        .filter(|(_, word)| *word == SOURCE)
        .map(|(at, _)| at + SOURCE.len());
    let place = |end: usize| {
        let path = loaded[..end].rsplit(|byte| !is_of_path(byte)).next()?;
        // Constants may lie side by side: the last path is the one that ends here.
        let path = String::from_utf8_lossy(path).into_owned();
        let begin = path[..path.len() - SOURCE.len()].rfind(".rs");
        Some(path[begin.map_or(0, |begin| begin + SOURCE.len())..].to_owned())
    };
    ends.filter_map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(loaded: &[u8]) -> Result<(), String> {
        judge(&places(loaded))
    }

    #[test]
    fn a_panic_of_our_own_and_a_check_that_sees_nothing_are_faults() {
        let queue = b"\0\x01/registry/embassy-sync-0.8.0/src/zerocopy_channel.rs\0";
        assert_eq!(judged(queue), Ok(()));
        let ours = [&queue[..], b"firmware/src/timing.rs\0"].concat();
        let found = judged(&ours);
        assert!(
            found
                .as_ref()
                .is_err_and(|why| why.ends_with("firmware/src/timing.rs")),
            "{found:?}"
        );
        let beside = b"a/src/zerocopy_channel.rsb/src/x.rsc";
        assert!(judged(beside).is_err_and(|why| why.ends_with("in b/src/x.rs")));
        assert!(judged(b"no places").is_err_and(|why| why.starts_with("not even")));
    }
}
