//! Conversion of recordings to files of samples and events.
//!
//! ```text
//! records ──► Playback: Core ──► Collector ──blocks, events──► Survey (first pass): times, counts
//!                                                         └──► StreamFiles (second pass): rows
//! ```
//!
//! A recording is played twice. An event can arrive after its sample, so the first pass finds the
//! sample of each event, and the second one writes.

pub(crate) mod bdf;
pub(crate) mod block;
pub(crate) mod collector;
pub(crate) mod convert;
pub(crate) mod csv;
pub(crate) mod gdf;
pub(crate) mod npz;
pub(crate) mod playback;
pub(crate) mod rows;
pub(crate) mod survey;
