//! Rehearsal of a session with faults, in virtual time.
//!
//! A [`Scenario`] is a file that states how long a board streams, over which line, and what goes
//! wrong. [`rehearse`] runs the virtual board, the faulty line and the bridge's core
//! ([`bridge_core::Core`]), and compares everything that the core publishes with what the board
//! made. No wall clock is read, and all random numbers come from the file's seed, so equal files
//! yield equal [`Report`]s.
//!
//! ```text
//! VirtualBoard ── frames ──► Line ── bytes ──► Core ── codes, events, counts ──► Ledger
//!      │          ◄─────── commands ────────    │                                  ▲
//!      └────────── Truth: what was made, when, by the host's true time ────────────┘
//! ```

mod clock;
mod file;
mod junit;
mod ledger;
mod line;
mod rehearsal;
mod report;
mod schedule;
mod signal;
mod topic;
mod truth;

pub use file::{Scenario, ScenarioError};
pub use junit::junit;
pub use rehearsal::{RehearsalError, rehearse};
pub use report::Report;
pub use signal::SignalError;
pub use topic::TopicCounts;
