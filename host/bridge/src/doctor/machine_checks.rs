//! Checks of the PC: its clock and its disk.

use crate::doctor::check::Check;

/// Space below which the disk is a warning, bytes: two hours of all streams, at 8 MB a minute.
const LEAST_SPACE: u64 = 120 * 8_000_000;

/// Checks the clock. `synchronised` is `None` if the state cannot be read.
pub(crate) fn check_clock(synchronised: Option<bool>) -> Check {
    const NAME: &str = "clock";
    match synchronised {
        Some(true) => Check::ok(NAME, "synchronised by NTP"),
        Some(false) => Check::warning(
            NAME,
            "not synchronised by NTP: stamps do not agree with other machines",
            "sudo timedatectl set-ntp true",
        ),
        None => Check::unknown(
            NAME,
            "its synchronisation cannot be read here",
            "timedatectl, or chronyc tracking",
        ),
    }
}

/// Checks the space that is free in the current folder, bytes. `None` if it cannot be read.
pub(crate) fn check_disk(free: Option<u64>) -> Check {
    const NAME: &str = "disk";
    let remedy = "df -h . (record in a folder with more space)";
    match free {
        Some(free) if free >= LEAST_SPACE => Check::ok(
            NAME,
            format!("{} GB free in this folder", free / 1_000_000_000),
        ),
        Some(free) => Check::warning(
            NAME,
            format!(
                "{} MB free in this folder: less than two hours of all streams",
                free / 1_000_000
            ),
            remedy,
        ),
        None => Check::unknown(NAME, "the free space cannot be read", remedy),
    }
}

#[cfg(test)]
mod tests {
    use super::{check_clock, check_disk};
    use crate::doctor::check::Level;

    #[test]
    fn a_clock_that_runs_free_is_a_warning_and_an_unreadable_one_unknown() {
        assert_eq!(check_clock(Some(true)).level, Level::Ok);
        let free = check_clock(Some(false));
        assert_eq!(free.level, Level::Warning);
        assert_eq!(
            free.remedy.as_deref(),
            Some("sudo timedatectl set-ntp true")
        );
        assert_eq!(check_clock(None).level, Level::Unknown);
    }

    #[test]
    fn a_disk_with_room_for_less_than_two_hours_is_a_warning() {
        let level = |free| check_disk(free).level;
        assert_eq!(level(Some(960_000_000)), Level::Ok);
        assert_eq!(level(Some(959_999_999)), Level::Warning);
        assert_eq!(level(None), Level::Unknown);
    }
}
