//! Destination of the bridge's frames.

/// Destination of the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum SinkKind {
    /// ROS 1 topics.
    #[default]
    Ros,
    /// Lines of JSON on stdout.
    Ndjson,
}
