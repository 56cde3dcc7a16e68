//! Charts as SVG files, drawn without system fonts or libraries.
//!
//! Each chart is a struct of plain numbers with a `draw` method that writes one file. The demo
//! draws a run of the signal path and the response of its filters, `host-sim decode` draws the
//! error of decoded recordings, and `trainer` draws the error of models. A [`page::Page`] shows the
//! pictures of a report.
//!
//! ```text
//! bench ────┬─ Intervals  histogram of intervals ───┐
//! demo  ────┼─ Traces     electrodes over time ─────┤
//!           ├─ HeatMap    codes over time ──────────┤
//! trainer ──┼─ Lines      lines and points ─────────┼─ canvas (title, axes, colours) ── *.svg
//!           ├─ Patterns   signed maps of the head ──┤
//! offline ──┼─ ScalpMap   a value per electrode ────┤
//!           └─ Histogram  counted values ───────────┘
//! ```
//!
//! ```
//! use picture::intervals::{Intervals, Series};
//!
//! let folder = tempfile::tempdir()?;
//! let file = folder.path().join("intervals.svg");
//! let intervals = Intervals {
//!     arrival: Series { name: "arrival".to_owned(), ms: vec![62.4, 62.5, 62.6] },
//!     source: Series { name: "device stamps".to_owned(), ms: vec![62.5, 62.5, 62.5] },
//!     rival: None,
//!     subtitle: "three intervals".to_owned(),
//! };
//! intervals.draw(&file)?;
//! assert!(std::fs::read_to_string(file)?.contains("three intervals"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod axis;
pub mod canvas;
pub mod heat_map;
pub mod histogram;
pub mod intervals;
pub mod lines;
pub mod page;
pub mod patterns;
pub mod scalp_map;
pub mod spread;
pub mod traces;
