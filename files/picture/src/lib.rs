//! Charts as SVG files, drawn without any font or library of the system.
//!
//! Each chart is a struct of plain numbers with a `draw` method that writes one file. The demo
//! draws a run of the signal path, the benchmarks draw the filters over frequency, `host-sim
//! decode` draws the error of decoded recordings, `trainer` that of models. A [`page::Page`] shows
//! the pictures of a report.
//!
//! ```text
//! demo  ────┬─ Traces     electrodes over time ─────┐
//!           ├─ HeatMap    codes over time ──────────┤
//! bench ────┼─ Intervals  histogram of intervals ───┤
//!           ├─ Lines      lines and points ─────────┼─ canvas (title, axes, colours) ── *.svg
//! offline ──┼─ ScalpMap   a value per electrode ────┤
//!           ├─ Histogram  counted values ───────────┤
//! trainer ──┴─ Patterns   signed maps of the head ──┘
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
