//! One round of the benchmark, and what every round shares.

/// Number of windows in a batch.
pub(super) const BATCH: usize = 32;
/// Number of updates in a round that are timed, after those that warm up.
pub(super) const UPDATES: usize = 20;
/// Number of updates at the start of a round that are not timed.
pub(super) const WARM_UP: usize = 2;
/// Learning rate of every update.
pub(super) const RATE: f64 = 1e-3;

/// What a contender did in one round.
#[derive(Debug, Clone, serde::Deserialize)]
pub(super) struct Round {
    /// Processor time of the timed updates, seconds.
    pub(super) seconds: f64,
    /// Mean squared error of each batch before its update, the warm-up included.
    pub(super) losses: Vec<f64>,
    /// Version of PyTorch.
    #[serde(default)]
    pub(super) version: Option<String>,
}
