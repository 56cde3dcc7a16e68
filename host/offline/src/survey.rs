//! The first pass over a file of codes: which windows it holds.

use std::io::Read;

use artifact::Description;

use crate::code_file::{Announcement, CodeFile, CodeFileError, CodeKind};
use crate::exclusions::Exclusions;

/// Consecutive windows whose codes are missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gap {
    /// Index of the first missing window.
    pub(crate) first: u32,
    /// Number of missing windows in the gap.
    pub(crate) windows: u32,
}

/// Contents of a file of codes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Survey {
    pub(crate) announcement: Announcement,
    /// Kind of the codes that are decoded.
    pub(crate) kind: CodeKind,
    /// Number of codes that are not decoded, because they are not of the kind `kind`.
    pub(crate) left_out: u64,
    /// Number of codes that are decoded.
    pub(crate) codes: u64,
    /// Number of windows from window 0 to the window of the last code, including missing windows.
    pub(crate) windows: u32,
    pub(crate) gaps: Vec<Gap>,
    pub(crate) exclusions: Exclusions,
    /// Number of frames whose content is lost because they are damaged.
    pub(crate) damaged: u32,
}

impl Survey {
    /// Reads all codes of a file.
    ///
    /// # Errors
    /// [`CodeFileError`] if the file cannot be decoded.
    pub(crate) fn new(
        mut file: CodeFile<impl Read>,
        description: &Description,
    ) -> Result<Self, CodeFileError> {
        let (mut codes, mut windows, mut gaps) = (0, 0, Vec::new());
        let mut kind = None;
        while let Some(code) = file.next_code()? {
            kind = Some(code.content.kind());
            codes += 1;
            if code.window > windows {
                gaps.push(Gap { first: windows, windows: code.window - windows });
            }
            windows = code.window.saturating_add(1);
        }
        let (Some(kind), Some(announcement)) = (kind, file.announcement()) else {
            let steps = description.window.steps;
            return Err(match file.missing_kind() {
                Some(kind) => CodeFileError::OtherKind(kind),
                None => CodeFileError::NoCodes(steps),
            });
        };
        Ok(Self {
            announcement: announcement.clone(),
            kind,
            left_out: file.left_out(),
            codes,
            windows,
            gaps,
            exclusions: file.exclusions().clone(),
            damaged: file.damaged(),
        })
    }

    /// Returns the number of windows whose codes are missing, over all gaps.
    pub(crate) fn missing(&self) -> u64 {
        self.gaps.iter().map(|gap| u64::from(gap.windows)).sum()
    }

    /// Returns the number of rows of the decoded signal: one hop for each window or block but the
    /// last, which counts with all its steps.
    pub(crate) fn rows(&self, description: &Description) -> u64 {
        let window = &description.window;
        let last = match self.kind {
            CodeKind::Packed => window.hop,
            CodeKind::Codes => window.steps,
        };
        (u64::from(self.windows) - 1) * window.hop as u64 + last as u64
    }
}
