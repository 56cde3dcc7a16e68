//! A white page with a title, and the colours that all pictures share.

use std::path::{Path, PathBuf};

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Part of a page to draw on.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// What drawing on a page gives.
pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Text and axes.
pub(crate) const INK: RGBColor = RGBColor(0x1f, 0x29, 0x33);
/// Second thoughts: subtitles, units.
pub(crate) const FAINT: RGBColor = RGBColor(0x62, 0x70, 0x80);
/// Grid lines.
pub(crate) const GRID: RGBColor = RGBColor(0xe4, 0xe9, 0xee);
/// What went in.
pub(crate) const SOURCE: RGBColor = RGBColor(0x2b, 0x6c, 0xb0);
/// What came out.
pub(crate) const RESULT: RGBColor = RGBColor(0xdd, 0x6b, 0x20);
/// What the paper or the design says.
pub(crate) const REFERENCE: RGBColor = RGBColor(0x2f, 0x85, 0x5a);

const FONT: &str = "Helvetica, Arial, DejaVu Sans, sans-serif";
/// Space above every plot, pixels: title and subtitle.
const HEAD: i32 = 78;
const MARGIN: i32 = 28;

/// A picture that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("the picture {} cannot be written: {why}", path.display())]
pub(crate) struct PictureError {
    path: PathBuf,
    why: String,
}

/// Writes one picture: a page of `size` pixels with title and subtitle, and below it what `draw` draws.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn page(
    path: &Path,
    size: (u32, u32),
    [title, subtitle]: [&str; 2],
    draw: impl FnOnce(&Area) -> Drawn,
) -> Result<(), PictureError> {
    let page = SVGBackend::new(path, size).into_drawing_area();
    let drawn = (|| {
        page.fill(&WHITE)?;
        page.draw(&Text::new(title, (MARGIN, 20), text(25, INK)))?;
        page.draw(&Text::new(subtitle, (MARGIN, 52), text(16, FAINT)))?;
        let (_, below) = page.split_vertically(HEAD);
        draw(&below)?;
        page.present()
    })();
    drawn.map_err(|error| PictureError {
        path: path.to_owned(),
        why: error.to_string(),
    })
}

/// Text of this height in pixels, its anchor at the top left.
pub(crate) fn text(height: u32, color: RGBColor) -> TextStyle<'static> {
    (FONT, height).into_font().color(&color)
}

/// Text that hangs at the given point: left, centre or right of it, vertically centred.
pub(crate) fn anchored(height: u32, color: RGBColor, side: HPos) -> TextStyle<'static> {
    text(height, color).pos(Pos::new(side, VPos::Center))
}

/// One entry of a legend: a short line and its words, at this pixel of the area.
pub(crate) fn legend(area: &Area, at: (i32, i32), color: RGBColor, words: &str) -> Drawn {
    let line = vec![at, (at.0 + 26, at.1)];
    area.draw(&PathElement::new(line, color.stroke_width(3)))?;
    area.draw(&Text::new(
        words.to_owned(),
        (at.0 + 34, at.1),
        anchored(16, INK, HPos::Left),
    ))
}
