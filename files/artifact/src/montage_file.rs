//! Montage files: text files with the scalp grid, the channel order and the ADC.

use crate::description::{Adc, AdcClock, AdcControl, AdcWiring, Grid, Montage};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Internal reference of an ADS1299, V (datasheet SBAS499, section 7.5).
const VREF_V: f64 = 4.5;

/// Contents of a montage file such as `files/montages/paper-61.toml`; an unknown field is an error.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MontageFile {
    /// Name of the montage, such as `paper-61`.
    pub name: String,
    /// One line for each row of the grid, front to back: labels or `_`, separated by blanks.
    grid: String,
    /// Electrodes in the order of the ADC's channels; `None` means the row-major order of the grid.
    pub order: Option<Vec<String>>,
    /// The ADC that records the montage.
    pub adc: MontageAdc,
}

/// The ADC of a montage: a chain of ADS1299 chips.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MontageAdc {
    /// Number of channels, 8 for each chip.
    pub channels: usize,
    /// Gain of the ADC's input amplifier.
    pub gain: u32,
    /// Sampling rate of each channel, Hz.
    pub rate_hz: u32,
    /// Connection of the chips' data outputs; by default, a daisy chain.
    #[serde(default)]
    pub wiring: AdcWiring,
    /// Source of the chips' clock; by default, external.
    #[serde(default)]
    pub clock: AdcClock,
    /// How the chips are reset, started and stopped; by default, with pins.
    #[serde(default)]
    pub control: AdcControl,
}

/// Why a montage file cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum MontageFileError {
    #[error("cannot read the montage {}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    /// The text is not TOML, or a field is missing, misspelt or of the wrong type.
    #[error("{} is no montage; files/montages/paper-61.toml is an example", path.display())]
    Toml { path: PathBuf, source: toml::de::Error },
}

impl MontageFile {
    /// Reads a montage from a file.
    ///
    /// # Errors
    /// If the file cannot be read or parsed. Whether the montage is valid is not checked.
    pub fn read(path: &Path) -> Result<Self, MontageFileError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| MontageFileError::File { path: path.to_owned(), source })?;
        Self::parse(path, &text)
    }

    /// Parses the text of a montage file; `path` only names the file in the error.
    ///
    /// # Errors
    /// If the text is not TOML with the fields of a montage. Whether the montage is valid is not
    /// checked.
    pub fn parse(path: &Path, text: &str) -> Result<Self, MontageFileError> {
        toml::from_str(text)
            .map_err(|source| MontageFileError::Toml { path: path.to_owned(), source })
    }

    /// Returns the scalp grid, whose rows can have different lengths if the montage is invalid.
    pub fn grid(&self) -> Grid {
        let lines = self.grid.lines().map(str::trim);
        let cells = lines
            .filter(|line| !line.is_empty())
            .map(|line| line.split_whitespace().map(str::to_owned).collect());
        Grid::new(cells.collect())
    }

    /// Returns the electrodes in the order of the ADC's channels.
    pub fn montage(&self) -> Montage {
        let electrodes = match &self.order {
            Some(order) => order.clone(),
            None => self.grid().electrodes(),
        };
        Montage { electrodes }
    }

    /// Returns the ADC as a model's description states it.
    pub fn adc(&self) -> Adc {
        Adc {
            rate_hz: self.adc.rate_hz,
            vref_v: VREF_V,
            gain: self.adc.gain,
            channels: self.adc.channels,
            wiring: self.adc.wiring,
            clock: self.adc.clock,
            control: self.adc.control,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "name = \"two\"\ngrid = \"\"\"\nC3 _ C4\n\nP3 _ P4\n\"\"\"\n\
        [adc]\nchannels = 8\ngain = 24\nrate_hz = 250\n";

    #[test]
    fn rows_are_lines_and_channels_follow_the_grid_without_an_order() {
        let file = MontageFile::parse(Path::new("two.toml"), TWO).unwrap();
        assert_eq!((file.grid().rows, file.grid().columns), (2, 3));
        assert_eq!(file.montage().electrodes, ["C3", "C4", "P3", "P4"]);
        assert_eq!(file.adc().wiring, AdcWiring::Daisy);
        let ordered = TWO.replace(
            "[adc]",
            "order = [\"P4\", \"C3\"]\n[adc]\nwiring = \"cascaded\"\nclock = \"internal\"",
        );
        let file = MontageFile::parse(Path::new("two.toml"), &ordered).unwrap();
        assert_eq!(file.montage().electrodes, ["P4", "C3"]);
        let adc = file.adc();
        let wired = (AdcWiring::Cascaded, AdcClock::Internal, AdcControl::Pins);
        assert_eq!((adc.wiring, adc.clock, adc.control), wired);
    }
}
