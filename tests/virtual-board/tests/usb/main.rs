//! The H743's image, unmodified, on the other end of a USB cable.
//!
//! `CORTICODE_H743_IMAGE` is the path of the ELF file that `cargo flash` writes; without it the test is
//! skipped. No converters are connected: the firmware reports that and serves its port.

mod board;
mod proof;

use std::path::Path;

use rigless::emulator::{self, Start};
use rigless::session::Session;
use rigless::time::VirtualNanos;
use virtual_board::usb::UsbHost;

use board::Nucleo;
use proof::Proof;

#[test]
fn the_image_is_a_serial_port_that_survives_what_hosts_do() {
    let Ok(image) = std::env::var("CORTICODE_H743_IMAGE") else {
        println!("SKIPPED: CORTICODE_H743_IMAGE is not set");
        return;
    };
    let host = UsbHost::new();
    let board = Nucleo::new(&host).unwrap();
    let session = Session::new(Box::new(board), 0, VirtualNanos(0)).unwrap();
    let images = [rigless::image::Image::read(Path::new(&image), None).unwrap()];
    let done = emulator::run(session, &Start::new(&images), Proof::new(host.clone())).unwrap();
    for line in host.log() {
        println!("{line}");
    }
    println!("{:?}", host.counters());
    assert_eq!(done.driver.failure, None);
    assert_eq!(done.driver.bad_frames, 0);
    let violations: Vec<_> = host.violations().iter().map(ToString::to_string).collect();
    assert_eq!(violations, [] as [String; 0]);
    assert!(
        done.session.unmapped().is_empty(),
        "{:x?}",
        done.session.unmapped()
    );
    assert!(
        done.session.refused().is_empty(),
        "{:x?}",
        done.session.refused()
    );
}
