//! Writes the image built by cargo as a DfuSe file, for `corticode-bridge update`.

use std::fs;
use std::path::{Path, PathBuf};

use dfuse::Image;
use object::read::elf::{ElfFile32, ProgramHeader as _};
use object::{LittleEndian, Object as _, ObjectSegment as _};
use serde_json::Value;

use crate::command::{Failure, OrFail};
use crate::images::Board;

/// Largest image, bytes: the flash of the STM32H743.
const MAX_BYTES: usize = 2 << 20;

/// Advice to the user when cargo's output is not as expected.
const NEXT: &str = "run `cargo clean` and repeat the command";

/// What cargo reports about the build of an image.
#[derive(Debug, Default, PartialEq, Eq)]
struct Build {
    elf: PathBuf,
    /// Version and commit, which the board's build script has set.
    firmware: String,
    /// Manifest of the model, written by the build script of the crate `model`.
    manifest: PathBuf,
}

/// Writes the DfuSe file next to the image's ELF file, and returns its path. `messages` is the
/// output of cargo with `--message-format=json`.
pub(crate) fn write(board: Board, messages: &str) -> Result<PathBuf, Failure> {
    let Build { elf, firmware, manifest } = build(messages);
    let reading = |path: &Path| format!("reading {}", path.display());
    let bytes = fs::read(&elf).or_fail(reading(&elf), NEXT)?;
    let text = fs::read_to_string(&manifest).or_fail(reading(&manifest), NEXT)?;
    let model = text.lines().next().and_then(|line| line.strip_prefix("model id"));
    let flash = flash_content(&bytes).zip(model);
    let ((address, content), model) =
        flash.ok_or("no ELF file for a flash, or no model id").or_fail(reading(&elf), NEXT)?;
    let image = Image {
        board: board.name().to_owned(),
        firmware,
        model: model.trim().to_owned(),
        address,
        content,
    };
    let path = elf.with_file_name(format!("corticode-{}.dfu", board.key()));
    let writing = format!("writing {}", path.display());
    let file = image.to_dfu().or_fail(&writing, NEXT)?;
    fs::write(&path, file).or_fail(&writing, "is the disk full?")?;
    Ok(path)
}

/// Returns the path of the ELF file that cargo's `messages` name.
pub(crate) fn elf(messages: &str) -> PathBuf {
    build(messages).elf
}

/// Reads cargo's messages, one per line, and returns the paths and the version in them.
fn build(messages: &str) -> Build {
    let mut build = Build::default();
    for line in messages.lines() {
        let message: Value = serde_json::from_str(line).unwrap_or_default();
        if let Some(elf) = message["executable"].as_str() {
            build.elf = elf.into();
        }
        let variables = message["env"].as_array().into_iter().flatten();
        for variable in variables.filter(|variable| variable[0] == "CORTICODE_FIRMWARE") {
            variable[1].as_str().unwrap_or_default().clone_into(&mut build.firmware);
        }
        let is_model =
            message["package_id"].as_str().is_some_and(|id| id.contains("/signal/model#"));
        if let (true, Some(folder)) = (is_model, message["out_dir"].as_str()) {
            build.manifest = Path::new(folder).join("manifest.txt");
        }
    }
    build
}

/// Returns address and content of the flash that the segments of an ELF file fill. Gaps are 0xFF,
/// as in erased flash.
fn flash_content(elf: &[u8]) -> Option<(u32, Vec<u8>)> {
    let file = ElfFile32::<LittleEndian>::parse(elf).ok()?;
    let segments = file.segments().map(|segment| {
        let address = segment.elf_program_header().p_paddr(LittleEndian);
        Some((address, segment.data().ok()?))
    });
    let mut segments: Vec<_> = segments.collect::<Option<_>>()?;
    segments.retain(|(_, data)| !data.is_empty());
    segments.sort_unstable_by_key(|(address, _)| *address);
    let start = segments.first()?.0;
    let mut content = Vec::new();
    for (address, data) in segments {
        let at = usize::try_from(address - start).ok()?;
        if at < content.len() || at + data.len() > MAX_BYTES {
            return None;
        }
        content.resize(at, 0xFF);
        content.extend_from_slice(data);
    }
    Some((start, content))
}

#[cfg(test)]
mod tests {
    use object::elf::PT_LOAD;

    use super::*;

    /// Builds an ELF file with segments of 4 bytes at these addresses in flash.
    fn elf(addresses: &[u32]) -> Vec<u8> {
        let mut elf = vec![0; 52];
        elf[..7].copy_from_slice(b"\x7fELF\x01\x01\x01");
        let count = u8::try_from(addresses.len()).expect("few segments");
        // Set the machine, then offset, size and number of the program headers (System V ABI,
        // chapter 4).
        for (at, byte) in [(18, 40), (28, 52), (42, 32), (44, count)] {
            elf[at] = byte;
        }
        for address in addresses {
            for field in [PT_LOAD, 0, 0x2000_0000, *address, 4, 4, 0, 4] {
                elf.extend(field.to_le_bytes());
            }
        }
        elf
    }

    #[test]
    fn segments_fill_the_flash_in_order_and_gaps_are_erased() {
        let content = flash_content(&elf(&[0x0800_0006, 0x0800_0000]));
        let (address, content) = content.expect("an image");
        assert_eq!(address, 0x0800_0000);
        assert_eq!(content, *b"\x7fELF\xFF\xFF\x7fELF");
        // Segments that overlap, segments that are too far apart, and no segment.
        for addresses in [&[0x0800_0000, 0x0800_0002][..], &[0, 0x0800_0000], &[]] {
            assert_eq!(flash_content(&elf(addresses)), None);
        }
    }

    #[test]
    fn version_and_paths_are_those_that_cargo_reports() {
        let messages = r#"{"reason":"build-script-executed","package_id":"path+file:///c/signal/model#0.1.0","env":[],"out_dir":"/t/model/out"}
{"reason":"build-script-executed","package_id":"path+file:///c/firmware/board-h743#0.1.0","env":[["CORTICODE_FIRMWARE","0.1.0 5d4b736"]],"out_dir":"/t/board/out"}
{"reason":"compiler-artifact","executable":null}
{"reason":"compiler-artifact","executable":"/t/board-h743"}
{"reason":"build-finished","success":true}"#;
        let expected = Build {
            elf: "/t/board-h743".into(),
            firmware: "0.1.0 5d4b736".to_owned(),
            manifest: "/t/model/out/manifest.txt".into(),
        };
        assert_eq!(build(messages), expected);
    }
}
