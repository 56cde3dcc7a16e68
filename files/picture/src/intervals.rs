//! Histogram of the time between codes, with the result of a published paper as a curve.

use std::path::Path;

use plotters::prelude::*;

use crate::canvas::{self, Area, Drawn, INK, PictureError, REFERENCE, RESULT, SOURCE, real};
use crate::spread::Spread;

/// Mean and SD of the interval between codes in arXiv 2008.13485 (interval histogram), ms.
const PAPER_MS: Spread = Spread { mean: 62.499, sd: 0.227 };

/// Intervals between the codes of one run, to be drawn as a histogram.
#[derive(Debug, Clone)]
pub struct Intervals {
    /// Intervals between the arrivals of successive codes at the subscriber, drawn as bars.
    pub arrival: Series,
    /// Intervals between the same codes at their source; a dashed line marks the mean interval.
    pub source: Series,
    /// Intervals between the arrivals of the same codes through another program, drawn as an
    /// outline.
    pub rival: Option<Series>,
    /// Line below the title, such as the number of codes and their path.
    pub subtitle: String,
}

/// Intervals between codes, with the name that the legend shows.
#[derive(Debug, Clone)]
pub struct Series {
    /// Name in the legend, such as "arrival at the subscriber".
    pub name: String,
    /// Intervals between successive codes, ms.
    pub ms: Vec<f64>,
}

/// Number of intervals in each of [`BINS`] bins of equal width.
struct Counted {
    counts: [f64; BINS],
    /// Number of intervals below the first or above the last bin.
    outside: u32,
}

const SIZE: (u32, u32) = (1200, 700);
const BINS: usize = 80;

impl Intervals {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let heading = ["Time between two codes", &self.subtitle];
        canvas::page(path, SIZE, heading, |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let spreads = [Some(&self.arrival), self.rival.as_ref()];
        let spreads = spreads.into_iter().flatten();
        let sd = spreads.map(|series| Spread::from_values(&series.ms).sd).fold(0.0, f64::max);
        // The axis is wide enough for the paper's curve and nearly all intervals; the legend states
        // how many intervals are outside.
        let reach = (4.0 * sd).clamp(4.0 * PAPER_MS.sd, 6.0);
        let (low, high) = (62.5 - reach, 62.5 + reach);
        let width = (high - low) / real(BINS);
        let arrival = Counted::new(&self.arrival.ms, low, width);
        let rival = self.rival.as_ref();
        let rival = rival.map(|rival| (rival, Counted::new(&rival.ms, low, width)));
        let inside: f64 = arrival.counts.iter().sum();
        let paper = |ms: f64| PAPER_MS.density(ms) * width * inside;
        let rival_counts = rival.iter().flat_map(|(_, counted)| counted.counts);
        let counts = arrival.counts.into_iter().chain(rival_counts);
        let top = 1.08 * counts.fold(paper(PAPER_MS.mean), f64::max);

        let y = format!("intervals per {width:.3} ms");
        let labels = [("interval (ms)", 2), (y.as_str(), 0)];
        let mut chart = canvas::bars(area, 84, [low, high], top, &arrival.counts, labels)?;
        if let Some((_, counted)) = &rival {
            let left = |bin: usize| low + real(bin) * width;
            let steps = counted.counts.iter().enumerate();
            let steps =
                steps.flat_map(|(bin, count)| [(left(bin), *count), (left(bin + 1), *count)]);
            let outline: Vec<(f64, f64)> = steps.collect();
            chart.draw_series([PathElement::new(outline, RESULT.stroke_width(2))])?;
        }
        let curve = (0..=400).map(|point| low + (high - low) * f64::from(point) / 400.0);
        let curve: Vec<(f64, f64)> = curve.map(|ms| (ms, paper(ms))).collect();
        chart.draw_series([PathElement::new(curve, REFERENCE.stroke_width(3))])?;
        let source = Spread::from_values(&self.source.ms);
        let dashes = (0..36).map(|dash| {
            let start = f64::from(dash) / 36.0 * top;
            let line = vec![(source.mean, start), (source.mean, start + top / 72.0)];
            PathElement::new(line, INK.stroke_width(2))
        });
        chart.draw_series(dashes)?;

        let paper = format!("the paper's node on a PC: {PAPER_MS} ms, as a normal curve");
        let of_source = format!("{}: {source} ms", self.source.name);
        canvas::legend(area, (90, 6), SOURCE, &arrival.label(&self.arrival))?;
        canvas::legend(area, (90, 32), INK, &of_source)?;
        canvas::legend(area, (620, 6), REFERENCE, &paper)?;
        rival.map_or(Ok(()), |(rival, counted)| {
            canvas::legend(area, (620, 32), RESULT, &counted.label(rival))
        })
    }
}

impl Counted {
    /// Counts `values` in bins of equal `width` from `low` on; all in ms.
    fn new(values: &[f64], low: f64, width: f64) -> Self {
        let mut counted = Self { counts: [0.0; BINS], outside: 0 };
        for value in values {
            let bin = (0..BINS).find(|bin| *value >= low && *value < low + real(bin + 1) * width);
            match bin {
                Some(bin) => counted.counts[bin] += 1.0,
                None => counted.outside += 1,
            }
        }
        counted
    }

    /// Returns the legend's text for `series`: name, mean, SD, and number of intervals outside the
    /// axis.
    fn label(&self, series: &Series) -> String {
        let (spread, outside) = (Spread::from_values(&series.ms), self.outside);
        format!("{}: {spread} ms, {outside} beyond the axis", series.name)
    }
}
