//! Opens the live page in the user's browser.

use std::fs::Permissions;
use std::io::{self, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::process::{Command, Stdio};
use std::time::Duration;

use tempfile::NamedTempFile;

/// Time after which the temporary file is deleted. By then, the browser has read it.
const READ_AFTER: Duration = Duration::from_secs(30);

/// Opens `url` in the browser of the desktop, with `xdg-open`. The address can hold the page's
/// token, and other users can read command lines, so `xdg-open` gets the path of a file that only
/// this user can read.
///
/// # Errors
///
/// The operating system's, if there is no `xdg-open` or the file cannot be written.
pub(crate) fn open(url: &str) -> io::Result<()> {
    let file = redirection(url)?;
    let mut browser = Command::new("xdg-open");
    browser.arg(file.path()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut browser = browser.spawn()?;
    std::thread::spawn(move || {
        let _ = browser.wait();
        std::thread::sleep(READ_AFTER);
        drop(file);
    });
    Ok(())
}

/// Creates a temporary HTML file that redirects the browser to `url`.
fn redirection(url: &str) -> io::Result<NamedTempFile> {
    let mut file = tempfile::Builder::new()
        .prefix("corticode-")
        .suffix(".html")
        .permissions(Permissions::from_mode(0o600))
        .tempfile()?;
    write!(file, "<!doctype html>\n<meta http-equiv=\"refresh\" content=\"0; url={url}\">\n")?;
    file.flush()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::redirection;

    #[test]
    fn only_this_user_can_read_the_address() {
        use std::os::unix::fs::PermissionsExt as _;
        let file = redirection("http://127.0.0.1:1/#token=abc").unwrap();
        let mode = file.path().metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        let text = std::fs::read_to_string(file.path()).unwrap();
        assert!(text.contains("0; url=http://127.0.0.1:1/#token=abc"));
    }
}
