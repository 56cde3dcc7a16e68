//! Dates and times as the header of an EDF file writes them.

const MONTHS: [&str; 12] = [
    "JAN", "FEB", "MAR", "APR", "MAY", "JUN", "JUL", "AUG", "SEP", "OCT", "NOV", "DEC",
];

/// Date and time of day, UTC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DateTime {
    year: i64,
    month: usize,
    day: i64,
    second_of_day: i64,
}

impl DateTime {
    /// Converts nanoseconds since 1970, UTC, rounding down to seconds. Source of the formula: H.
    /// Hinnant, "chrono-Compatible Low-Level Date Algorithms", `civil_from_days`.
    pub(crate) fn new(wall_ns: i64) -> DateTime {
        let seconds = wall_ns.div_euclid(1_000_000_000);
        // The formula counts days from 1 March of the year 0, in eras of 400 years.
        let days = seconds.div_euclid(86_400) + 719_468;
        let (era, day_of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
        let leap_days = day_of_era / 1_460 - day_of_era / 36_524 + day_of_era / 146_096;
        let year_of_era = (day_of_era - leap_days) / 365;
        let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
        let month_from_march = (5 * day_of_year + 2) / 153;
        let month = (month_from_march + 2) % 12;
        DateTime {
            year: era * 400 + year_of_era + i64::from(month < 2),
            month: usize::try_from(month).unwrap_or(0),
            day: day_of_year - (153 * month_from_march + 2) / 5 + 1,
            second_of_day: seconds.rem_euclid(86_400),
        }
    }

    /// Returns the date in the form `02.08.51`.
    pub(crate) fn short_date(self) -> String {
        let year = self.year.rem_euclid(100);
        format!("{:02}.{:02}.{year:02}", self.day, self.month + 1)
    }

    /// Returns the date in the form `02-AUG-1951`.
    pub(crate) fn long_date(self) -> String {
        format!("{:02}-{}-{:04}", self.day, MONTHS[self.month], self.year)
    }

    /// Returns the time of day in the form `23.59.59`.
    pub(crate) fn time(self) -> String {
        let second = self.second_of_day;
        let (hour, minute) = (second / 3600, second / 60 % 60);
        format!("{hour:02}.{minute:02}.{:02}", second % 60)
    }
}

#[cfg(test)]
mod tests {
    use super::DateTime;

    #[test]
    fn dates_of_leap_years_and_of_the_turn_of_the_year_are_right() {
        for (seconds, long, time) in [
            (0, "01-JAN-1970", "00.00.00"),
            (951_782_399, "28-FEB-2000", "23.59.59"),
            (951_782_400, "29-FEB-2000", "00.00.00"),
            (1_700_000_000, "14-NOV-2023", "22.13.20"),
            (1_735_689_599, "31-DEC-2024", "23.59.59"),
            (1_735_689_600, "01-JAN-2025", "00.00.00"),
        ] {
            let date = DateTime::new(seconds * 1_000_000_000);
            assert_eq!((&*date.long_date(), &*date.time()), (long, time));
        }
        assert_eq!(
            DateTime::new(1_700_000_000_000_000_000).short_date(),
            "14.11.23"
        );
    }
}
