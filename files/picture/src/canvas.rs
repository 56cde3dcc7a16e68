//! Parts that all charts share: page with title and subtitle, colours, text styles, legend.

use std::path::Path;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Part of an SVG page on which a chart is drawn.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Dark blue-grey for text, ticks and emphasised lines.
pub const INK: RGBColor = RGBColor(0x1f, 0x29, 0x33);
/// Grey of subtitles and axes.
pub const FAINT: RGBColor = RGBColor(0x62, 0x70, 0x80);
/// Light grey of grid lines.
pub(crate) const GRID: RGBColor = RGBColor(0xe4, 0xe9, 0xee);
/// Blue for input signals; in comparisons, for this project's results.
pub const SOURCE: RGBColor = RGBColor(0x2b, 0x6c, 0xb0);
/// Orange for output signals; in comparisons, for all other results.
pub const RESULT: RGBColor = RGBColor(0xdd, 0x6b, 0x20);
/// Green for reference values, such as published results or the designed response of a filter.
pub const REFERENCE: RGBColor = RGBColor(0x2f, 0x85, 0x5a);

const FONT: &str = "Helvetica, Arial, DejaVu Sans, sans-serif";
/// Height of the strip above every plot for title and subtitle, pixels.
pub(crate) const HEAD: i32 = 78;
/// Distance of title and subtitle from the left edge of the page, pixels.
const MARGIN: i32 = 28;

/// Error: the file of a picture cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("the picture {path} cannot be written: {why}")]
pub struct PictureError {
    path: String,
    why: String,
}

/// Writes an SVG file of `size` pixels (width, height) with a title and a subtitle, and lets `draw`
/// fill the area below them.
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
    drawn.map_err(|error| PictureError { path: path.display().to_string(), why: error.to_string() })
}

/// Returns a builder for a chart with a labelled x axis. `top`, `left` and `right` are margins, and
/// `y_labels` is the width of the y axis's labels, all in pixels.
pub(crate) fn chart<'a, 'b>(
    area: &'a Area<'b>,
    [top, left, right]: [i32; 3],
    y_labels: u32,
) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut chart = ChartBuilder::on(area);
    chart.margin_top(top).margin_left(left).margin_right(right);
    chart.margin_bottom(16).x_label_area_size(52);
    chart.y_label_area_size(y_labels);
    chart
}

/// A chart with two linear axes.
pub(crate) type Chart<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws axes and bars of a histogram, `top` pixels below the top of the area. Returns the chart,
/// so that the caller can draw lines over the bars.
///
/// `counts` are the heights of the bins, which divide the x axis from `low` to `high` evenly;
/// `highest` is the upper end of the y axis. The last argument holds the label and the number of
/// decimal places of each axis.
pub(crate) fn bars<'a, 'b>(
    area: &'a Area<'b>,
    top: i32,
    [low, high]: [f64; 2],
    highest: f64,
    counts: &[f64],
    [(x, x_places), (y, y_places)]: [(&str, usize); 2],
) -> Result<Chart<'a, 'b>, DrawingAreaErrorKind<std::io::Error>> {
    let mut chart = chart(area, [top, 20, 36], 66).build_cartesian_2d(low..high, 0.0..highest)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(WHITE)
        .bold_line_style(GRID)
        .axis_style(FAINT)
        .x_labels(9)
        .x_label_formatter(&|value| format!("{value:.x_places$}"))
        .y_labels(7)
        .y_label_formatter(&|count| format!("{count:.y_places$}"))
        .x_desc(x)
        .y_desc(y)
        .label_style(text(15, INK))
        .axis_desc_style(text(16, INK))
        .draw()?;
    let width = (high - low) / real(counts.len());
    for (bin, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
        let left = low + real(bin) * width;
        let corners = [(left, 0.0), (left + width, *count)];
        chart.draw_series([Rectangle::new(corners, SOURCE.mix(0.75).filled())])?;
    }
    Ok(chart)
}

/// Returns a style for text of `height` pixels that is anchored at its top left corner.
pub(crate) fn text(height: u32, color: RGBColor) -> TextStyle<'static> {
    (FONT, height).into_font().color(&color)
}

/// Returns a style for text of `height` pixels that is anchored at its vertical centre and,
/// horizontally, at `side`.
pub(crate) fn anchored(height: u32, color: RGBColor, side: HPos) -> TextStyle<'static> {
    text(height, color).pos(Pos::new(side, VPos::Center))
}

/// Draws one entry of a legend, a short line and its label, at pixel `at` of the area.
pub(crate) fn legend(area: &Area, at: (i32, i32), color: RGBColor, label: &str) -> Drawn {
    let line = vec![at, (at.0 + 26, at.1)];
    area.draw(&PathElement::new(line, color.stroke_width(3)))?;
    let style = anchored(16, INK, HPos::Left);
    area.draw(&Text::new(label.to_owned(), (at.0 + 34, at.1), style))
}

/// Converts page pixel coordinates, which charts return, to pixel coordinates in `area`, which must
/// start at the page's left edge.
pub(crate) fn inside(area: &Area, (x, y): (i32, i32)) -> (i32, i32) {
    (x, y - area.get_base_pixel().1)
}

/// Converts a count to a float, saturating at 2^32 - 1.
pub(crate) fn real(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}
