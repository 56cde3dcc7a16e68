//! When something came.

use crate::trigger::Trigger;
use crate::{Clock, HostTime};

/// When something came, and what tells of the times before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// When it was read.
    pub(crate) read: HostTime,
    pub(crate) clock: &'a Clock,
    pub(crate) trigger: &'a Trigger,
}
