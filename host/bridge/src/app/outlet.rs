//! Outlets, the destinations of the bridge's messages, and the fan-out of each message to all of
//! them.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use neuro_ros::{KeyValue, Sink, SinkError};

use crate::app::command_line::SinkKind;

/// State of one outlet, shared by its sinks for all topics.
#[derive(Debug)]
pub(crate) struct Outlet {
    kind: SinkKind,
    dropped: AtomicU64,
    /// Whether this outlet can publish nothing more, for example because the reader has gone.
    closed: AtomicBool,
}

impl Outlet {
    pub(crate) fn new(kind: SinkKind) -> Arc<Outlet> {
        Arc::new(Outlet { kind, dropped: AtomicU64::new(0), closed: AtomicBool::new(false) })
    }

    pub(crate) const fn kind(&self) -> SinkKind {
        self.kind
    }

    /// Returns the counts so far, plus `dropped_later` messages that were dropped after the outlet
    /// had accepted them.
    pub(crate) fn count(&self, dropped_later: u64) -> OutletCount {
        OutletCount {
            kind: self.kind,
            dropped: self.dropped.load(Ordering::Relaxed) + dropped_later,
            closed: self.closed.load(Ordering::Relaxed),
        }
    }
}

/// Number of messages that an outlet has dropped because it was too slow. Its display form is a
/// part of the program's last line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutletCount {
    kind: SinkKind,
    pub(crate) dropped: u64,
    pub(crate) closed: bool,
}

impl OutletCount {
    pub(crate) const fn name(&self) -> &'static str {
        self.kind.name()
    }

    /// Returns the number of dropped messages, as a value for `/diagnostics`.
    pub(crate) fn value(&self) -> KeyValue {
        KeyValue::new(&format!("{} messages dropped", self.name()), &self.dropped)
    }
}

impl fmt::Display for OutletCount {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} dropped {}", self.name(), self.dropped)?;
        if self.closed {
            formatter.write_str(" closed")?;
        }
        Ok(())
    }
}

/// Adds the messages that one sink drops to its outlet's count.
#[derive(Debug)]
pub(crate) struct DropCount {
    outlet: Arc<Outlet>,
    counted: u64,
}

impl DropCount {
    pub(crate) const fn new(outlet: Arc<Outlet>) -> DropCount {
        DropCount { outlet, counted: 0 }
    }

    /// Sets the sink's total to `dropped`, and adds the increase to the outlet's count.
    pub(crate) fn update(&mut self, dropped: u64) {
        let new = dropped.saturating_sub(self.counted);
        self.counted += new;
        self.outlet.dropped.fetch_add(new, Ordering::Relaxed);
    }
}

/// Sink of one topic that passes each message to the sinks of all outlets. A sink that fails is
/// left out from then on. Only the failure of the last remaining sink is an error.
pub(crate) struct Tee<M> {
    ends: Vec<End<M>>,
}

/// The sink of a topic at one outlet.
struct End<M> {
    sink: Box<dyn Sink<M>>,
    drops: DropCount,
    closed: bool,
}

impl<M> Tee<M> {
    pub(crate) const fn new() -> Tee<M> {
        Tee { ends: Vec::new() }
    }

    pub(crate) fn add(&mut self, outlet: &Arc<Outlet>, sink: Box<dyn Sink<M>>) {
        self.ends.push(End { sink, drops: DropCount::new(Arc::clone(outlet)), closed: false });
    }
}

impl<M> Sink<M> for Tee<M> {
    fn publish(&mut self, message: &M) -> Result<(), SinkError> {
        let mut failure = Ok(());
        for end in self.ends.iter_mut().filter(|end| !end.closed) {
            let published = end.sink.publish(message);
            end.drops.update(end.sink.dropped());
            if let Err(error) = published {
                end.closed = true;
                let outlet = &end.drops.outlet;
                if !outlet.closed.swap(true, Ordering::Relaxed) {
                    let name = outlet.kind.name();
                    tracing::warn!("the outlet {name} receives nothing any more: {error}");
                }
                failure = Err(error);
            }
        }
        if self.ends.iter().all(|end| end.closed) {
            return failure;
        }
        Ok(())
    }

    fn dropped(&self) -> u64 {
        self.ends.iter().map(|end| end.sink.dropped()).sum()
    }

    fn has_receivers(&self) -> bool {
        let mut open = self.ends.iter().filter(|end| !end.closed);
        open.any(|end| end.sink.has_receivers())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Accepts `room` messages, drops further ones, and fails after `fails_at` messages.
    struct Bounded {
        room: u64,
        fails_at: u64,
        published: u64,
    }

    impl Sink<u8> for Bounded {
        fn publish(&mut self, _: &u8) -> Result<(), SinkError> {
            self.published += 1;
            if self.published > self.fails_at {
                return Err(SinkError::Closed);
            }
            Ok(())
        }

        fn dropped(&self) -> u64 {
            self.published.min(self.fails_at).saturating_sub(self.room)
        }

        fn has_receivers(&self) -> bool {
            self.room > 0
        }
    }

    fn tee(sinks: [(u64, u64); 2]) -> (Tee<u8>, [Arc<Outlet>; 2]) {
        let outlets = [SinkKind::Ros, SinkKind::Ndjson].map(Outlet::new);
        let mut tee = Tee::new();
        for ((room, fails_at), outlet) in sinks.into_iter().zip(&outlets) {
            let sink = Bounded { room, fails_at, published: 0 };
            tee.add(outlet, Box::new(sink));
        }
        (tee, outlets)
    }

    #[test]
    fn what_one_outlet_drops_is_counted_there_alone() {
        let (mut tee, [first, second]) = tee([(100, 100), (7, 100)]);
        for _ in 0..10 {
            tee.publish(&1).unwrap();
        }
        assert_eq!(first.count(0).to_string(), "ros dropped 0");
        assert_eq!(second.count(0).to_string(), "ndjson dropped 3");
        assert_eq!(second.count(2).dropped, 5);
        assert_eq!(tee.dropped(), 3);
    }

    #[test]
    fn an_outlet_that_fails_is_left_out_and_only_the_last_failure_is_an_error() {
        let (mut tee, [first, second]) = tee([(100, 4), (0, 2)]);
        for _ in 0..4 {
            tee.publish(&1).unwrap();
        }
        assert_eq!(second.count(0).to_string(), "ndjson dropped 2 closed");
        assert!(!first.count(0).closed);
        assert!(tee.has_receivers());
        assert!(matches!(tee.publish(&1), Err(SinkError::Closed)));
        assert!(first.count(0).closed && !tee.has_receivers());
        tee.publish(&1).unwrap();
    }
}
