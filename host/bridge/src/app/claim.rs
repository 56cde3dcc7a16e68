//! Whether a topic can be published without another publisher of the same topic.

/// Number of checks in a row in which a topic must be free before it is published after a conflict.
/// After a restart of the ROS master its publishers register again within two checks.
const FREE_CHECKS: u32 = 3;

/// The bridge's claim to one topic. A recorder allocates by the shape of one publisher and then
/// copies the frames of all of them, so a topic must have one publisher.
#[derive(Debug, Default)]
pub(crate) struct Claim {
    published: bool,
    /// Other nodes that publish the topic, as of the last check.
    others: Vec<String>,
    /// Number of checks in a row: of those that found another publisher while the bridge publishes,
    /// else of those that found none.
    checks: u32,
    /// Whether another publisher was found before.
    contested: bool,
}

/// What a check of the publishers requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Keep,
    Publish,
    Withdraw,
}

impl Claim {
    /// Returns the other nodes that published the topic at the last check.
    pub(crate) fn others(&self) -> &[String] {
        &self.others
    }

    /// Compares the claim with `publishers` of the topic, in the order of their registration; `own`
    /// is the bridge's node.
    ///
    /// If the bridge registered first, it withdraws at the second check that finds another
    /// publisher: a bridge that came later withdraws at once, and one of the two must stay.
    pub(crate) fn check(&mut self, own: &str, publishers: &[String]) -> Change {
        let others = publishers.iter().filter(|node| *node != own);
        self.others = others.cloned().collect();
        let is_free = self.others.is_empty();
        self.contested |= !is_free;
        let is_first = publishers.first().is_some_and(|node| node == own);
        self.checks = if is_free == self.published {
            0
        } else {
            self.checks + 1
        };
        let change = match (self.published, is_free) {
            (true, false) if !is_first || self.checks > 1 => Change::Withdraw,
            (false, true) if !self.contested || self.checks >= FREE_CHECKS => Change::Publish,
            _ => return Change::Keep,
        };
        self.published = change == Change::Publish;
        self.checks = 0;
        change
    }

    /// Records that the topic could not be advertised; the next check tries again.
    pub(crate) fn refused(&mut self) {
        self.published = false;
    }
}

#[cfg(test)]
mod tests {
    use super::{Change, Claim};

    fn nodes(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn a_topic_of_another_node_is_published_after_it_has_been_free_for_three_checks() {
        let mut claim = Claim::default();
        assert_eq!(claim.check("/us", &nodes(&["/filter"])), Change::Keep);
        assert_eq!(claim.others(), ["/filter"]);
        for change in [Change::Keep, Change::Keep, Change::Publish, Change::Keep] {
            assert_eq!(claim.check("/us", &[]), change);
        }
    }

    #[test]
    fn of_two_bridges_that_start_together_the_first_one_publishes() {
        let (mut first, mut second) = (Claim::default(), Claim::default());
        assert_eq!(first.check("/a", &[]), Change::Publish);
        assert_eq!(second.check("/b", &[]), Change::Publish);
        let both = nodes(&["/a", "/b"]);
        assert_eq!(first.check("/a", &both), Change::Keep);
        assert_eq!(second.check("/b", &both), Change::Withdraw);
        assert_eq!(first.check("/a", &nodes(&["/a"])), Change::Keep);
        assert_eq!(first.check("/a", &both), Change::Keep);
    }

    #[test]
    fn a_node_that_stays_beside_the_bridge_ends_its_publication() {
        let mut claim = Claim::default();
        let both = nodes(&["/us", "/filter"]);
        for (publishers, change) in [
            (&[][..], Change::Publish),
            (&both[..1], Change::Keep),
            (&both, Change::Keep),
            (&both, Change::Withdraw),
            (&both[1..], Change::Keep),
        ] {
            assert_eq!(claim.check("/us", publishers), change);
        }
    }
}
