//! Dates and times as EDF headers state them: in local time.

use jiff::civil;
use jiff::{Timestamp, tz::TimeZone};

/// Start stated in a file whose start is unknown: the first day that EDF can state.
const UNKNOWN: civil::DateTime = civil::DateTime::constant(1985, 1, 1, 0, 0, 0, 0);

/// Start of a file in the local time of this machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct LocalStart {
    local: civil::DateTime,
    is_known: bool,
}

impl LocalStart {
    /// Converts nanoseconds since 1970, UTC, to the time zone `zone`; `None` means an unknown
    /// start.
    pub(crate) fn new(wall_ns: Option<i64>, zone: &TimeZone) -> LocalStart {
        let timestamp = wall_ns.and_then(|ns| Timestamp::from_nanosecond(ns.into()).ok());
        LocalStart {
            local: timestamp.map_or(UNKNOWN, |timestamp| zone.to_datetime(timestamp)),
            is_known: timestamp.is_some(),
        }
    }

    /// Returns day, month and year in the form `02.08.51`.
    pub(crate) fn short_date(self) -> String {
        self.local.strftime("%d.%m.%y").to_string()
    }

    /// Returns the date in the form `02-AUG-1951`; `X` if it is unknown.
    pub(crate) fn long_date(self) -> String {
        if !self.is_known {
            return "X".to_owned();
        }
        self.local.strftime("%d-%b-%Y").to_string().to_uppercase()
    }

    /// Returns the time of day in the form `23.59.59`, rounded down to whole seconds.
    pub(crate) fn time(self) -> String {
        self.local.strftime("%H.%M.%S").to_string()
    }
}

#[cfg(test)]
mod tests {
    use jiff::tz::TimeZone;

    use super::LocalStart;

    #[test]
    fn a_start_is_local_time_also_in_summer_and_at_the_turn_of_the_year() {
        let new_york = TimeZone::posix("EST5EDT,M3.2.0,M11.1.0").unwrap();
        for (seconds, zone, short, long, time) in [
            (Some(0), &TimeZone::UTC, "01.01.70", "01-JAN-1970", "00.00.00"),
            (Some(951_782_400), &TimeZone::UTC, "29.02.00", "29-FEB-2000", "00.00.00"),
            (Some(1_735_689_600), &new_york, "31.12.24", "31-DEC-2024", "19.00.00"),
            (Some(1_719_792_000), &new_york, "30.06.24", "30-JUN-2024", "20.00.00"),
            (None, &new_york, "01.01.85", "X", "00.00.00"),
        ] {
            let start = LocalStart::new(seconds.map(|seconds: i64| seconds * 1_000_000_000), zone);
            let written = (start.short_date(), start.long_date(), start.time());
            assert_eq!(written, (short.to_owned(), long.to_owned(), time.to_owned()));
        }
    }
}
