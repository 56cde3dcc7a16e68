//! Collects log events, so that tests can count them.

use std::{cell::RefCell, fmt::Debug};

use tracing::{
    Event, Level, Metadata,
    field::{Field, Visit},
    span,
};

thread_local! {
    static LINES: RefCell<Vec<(Level, String)>> = RefCell::default();
}

/// The log events of the current thread since [`Log::start`], at level INFO and above.
pub(crate) struct Log;

impl Log {
    pub(crate) fn start() -> Self {
        // One collector serves all threads: tracing caches for each call site whether any collector
        // wants its events, and collectors that come and go with the tests would race for this
        // cache. Setting the collector fails if another test has already set it.
        let _ = tracing::subscriber::set_global_default(Collector);
        LINES.take();
        Self
    }

    /// Returns the number of events of this level whose message contains `part`.
    #[expect(clippy::unused_self, reason = "there are lines only after the start")]
    pub(crate) fn count(&self, level: Level, part: &str) -> usize {
        LINES.with_borrow(|lines| {
            let found = lines.iter().filter(|(of, line)| *of == level && line.contains(part));
            found.count()
        })
    }
}

struct Collector;

/// Visitor that extracts the message of an event.
#[derive(Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

impl tracing::Subscriber for Collector {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        *metadata.level() <= Level::INFO
    }

    fn new_span(&self, _: &span::Attributes<'_>) -> span::Id {
        span::Id::from_u64(1)
    }

    fn record(&self, _: &span::Id, _: &span::Record<'_>) {}

    fn record_follows_from(&self, _: &span::Id, _: &span::Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut message = Message::default();
        event.record(&mut message);
        let line = (*event.metadata().level(), message.0);
        LINES.with_borrow_mut(|lines| lines.push(line));
    }

    fn enter(&self, _: &span::Id) {}

    fn exit(&self, _: &span::Id) {}
}
