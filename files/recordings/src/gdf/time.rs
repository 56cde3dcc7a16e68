//! Time stamps of GDF 2.

/// Days from GDF's day 0 (1 January of the year 0) to 1 January 1970.
const DAYS_TO_1970: i128 = 719_529;
/// Nanoseconds in a day.
const DAY_NS: i128 = 86_400_000_000_000;

/// Converts nanoseconds since 1970 to GDF's time: days in the upper 32 bits, fractions of a day in
/// the lower 32.
pub(crate) fn gdf_time(wall_ns: i64) -> u64 {
    let days = (i128::from(wall_ns) << 32) / DAY_NS;
    u64::try_from((DAYS_TO_1970 << 32) + days).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::gdf_time;

    #[test]
    fn a_day_is_2_to_the_32() {
        assert_eq!(gdf_time(0), 719_529 << 32);
        // 2000-01-01 12:00 is day 730,486.5 of the proleptic calendar with a year 0.
        assert_eq!(
            gdf_time(946_728_000_000_000_000),
            (730_486 << 32) + (1 << 31)
        );
    }
}
