//! A simulated board with a DfuSe loader as AN3156 and DFU 1.1 describe it. The board's time is
//! virtual.

use std::cell::RefCell;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use bridge_core::{DeviceSummary, QueryError};
use dfuse::Image;

use crate::error::BridgeError;
use crate::update::Machine;
use crate::update::flash_layout::FlashLayout;
use crate::update::programmer::{
    ABORT, CLEAR_STATUS, DNLOAD, DOWNLOAD_BUSY, DOWNLOAD_IDLE, ERASE, ERASED, ERROR, FLASH_WORD,
    GET_STATUS, IDLE, Loader, SET_ADDRESS, UPLOAD,
};

/// States of the loader that the module `programmer` does not need.
const DOWNLOAD_SYNC: u8 = 3;
const MANIFEST: u8 = 7;
const UPLOAD_IDLE: u8 = 9;

/// What runs on the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Runs {
    /// The program in the flash, if the flash holds an image.
    Flash,
    Loader,
}

/// The chip of a board, and the faults that a test gives it.
pub(super) struct Chip {
    pub(super) runs: Runs,
    pub(super) flash: Vec<u8>,
    /// Images that the flash can start, with the boards that they are for.
    pub(super) images: Vec<Image>,
    /// Number of requests after which the loader loses its power.
    pub(super) requests_left: usize,
    /// Kind of command that the loader refuses, and the status that it reports for it.
    pub(super) refuses: Option<(u8, u8)>,
    /// Address of a byte that is programmed wrongly.
    pub(super) defect: Option<u32>,
    /// Whether the loader starts the image without answering the last request.
    pub(super) leaves_silently: bool,
    pub(super) layout: &'static str,
    transfer_size: u16,
    sectors: FlashLayout,
    now: Duration,
    state: u8,
    status: u8,
    pointer: u32,
    download: (u16, Vec<u8>),
    busy_until: Duration,
}

impl Chip {
    fn offset(&self, address: u32, length: usize) -> Option<usize> {
        let offset = usize::try_from(address.checked_sub(self.sectors.range().start)?).ok()?;
        (offset + length <= self.flash.len()).then_some(offset)
    }

    fn address(&self, block: u16) -> u32 {
        self.pointer + u32::from(block - 2) * u32::from(self.transfer_size)
    }

    fn request(&mut self) -> io::Result<()> {
        if self.requests_left == 0 {
            // BOOT0 is low: after a loss of power the chip runs what its flash holds.
            self.runs = Runs::Flash;
        }
        self.requests_left = self.requests_left.saturating_sub(1);
        match self.runs {
            Runs::Flash => Err(io::ErrorKind::ConnectionAborted.into()),
            Runs::Loader => Ok(()),
        }
    }

    fn send(&mut self, request: u8, block: u16, data: &[u8]) -> io::Result<()> {
        self.request()?;
        assert!(self.now >= self.busy_until, "a request to a busy loader");
        let is_long = data.len() > usize::from(self.transfer_size);
        self.state = match (request, self.state) {
            (DNLOAD, IDLE | DOWNLOAD_IDLE) if !is_long => {
                self.download = (block, data.to_vec());
                DOWNLOAD_SYNC
            }
            (ABORT, IDLE | DOWNLOAD_IDLE | UPLOAD_IDLE) | (CLEAR_STATUS, ERROR) => IDLE,
            _ => {
                (self.state, self.status) = (ERROR, 0x0F);
                return Err(io::ErrorKind::ConnectionReset.into());
            }
        };
        if self.state == IDLE {
            self.status = 0;
        }
        Ok(())
    }

    fn receive(&mut self, request: u8, block: u16, length: u16) -> io::Result<Vec<u8>> {
        self.request()?;
        assert!(self.now >= self.busy_until, "a request to a busy loader");
        if request == GET_STATUS {
            return self.report();
        }
        let readable = matches!(self.state, IDLE | UPLOAD_IDLE) && length <= self.transfer_size;
        assert!(request == UPLOAD && block >= 2 && readable, "a stall");
        self.state = UPLOAD_IDLE;
        let length = usize::from(length);
        let offset = self.offset(self.address(block), length).expect("in flash");
        Ok(self.flash[offset..offset + length].to_vec())
    }

    /// Answers `GET_STATUS`. After a download, this request also carries out the downloaded command
    /// or block.
    fn report(&mut self) -> io::Result<Vec<u8>> {
        let mut wait_ms = 0;
        match self.state {
            DOWNLOAD_SYNC if self.download.1.is_empty() => {
                self.runs = Runs::Flash;
                assert_eq!(self.pointer, self.sectors.range().start);
                if self.leaves_silently {
                    return Err(io::ErrorKind::ConnectionReset.into());
                }
                self.state = MANIFEST;
            }
            DOWNLOAD_SYNC => {
                self.state = DOWNLOAD_BUSY;
                let (block, data) = std::mem::take(&mut self.download);
                let kind = if block == 0 { data[0] } else { DNLOAD };
                wait_ms = if kind == ERASE { 900 } else { 5 };
                self.status = match self.refuses {
                    Some((refused, status)) if refused == kind => status,
                    _ => self.execute(block, &data).err().unwrap_or(0),
                };
            }
            DOWNLOAD_BUSY if self.status == 0 => self.state = DOWNLOAD_IDLE,
            DOWNLOAD_BUSY => self.state = ERROR,
            _ => {}
        }
        self.busy_until = self.now + Duration::from_millis(wait_ms);
        let wait = u8::try_from(wait_ms % 256).unwrap();
        let wait = [wait, u8::try_from(wait_ms / 256).unwrap(), 0];
        let status = if self.state == DOWNLOAD_BUSY { 0 } else { self.status };
        Ok([&[status][..], &wait, &[self.state, 0]].concat())
    }

    /// Carries out a command or writes a block. The error is the status that the loader reports.
    fn execute(&mut self, block: u16, data: &[u8]) -> Result<(), u8> {
        const WRONG_ADDRESS: u8 = 0x08;
        if block >= 2 {
            let address = self.address(block);
            let offset = self.offset(address, data.len()).ok_or(WRONG_ADDRESS)?;
            let is_aligned =
                offset.is_multiple_of(FLASH_WORD) && data.len().is_multiple_of(FLASH_WORD);
            let target = &mut self.flash[offset..offset + data.len()];
            if !is_aligned || target.iter().any(|byte| *byte != ERASED) {
                return Err(0x06);
            }
            target.copy_from_slice(data);
            let defect = self.defect.and_then(|address| self.offset(address, 1));
            if let Some(defect) = defect.filter(|at| (offset..offset + data.len()).contains(at)) {
                self.flash[defect] ^= 1;
            }
        } else {
            let address = u32::from_le_bytes(data[1..].try_into().unwrap());
            self.offset(address, 1).ok_or(WRONG_ADDRESS)?;
            match data[0] {
                SET_ADDRESS => self.pointer = address,
                ERASE => {
                    let mut sectors = self.sectors.sectors.iter();
                    let sector = sectors.find(|sector| sector.contains(&address));
                    let sector = sector.unwrap().clone();
                    let offset = self.offset(sector.start, sector.len()).unwrap();
                    self.flash[offset..offset + sector.len()].fill(ERASED);
                }
                other => panic!("command {other:#04x}"),
            }
        }
        Ok(())
    }

    /// Returns the image that the flash starts: none if the vector table is erased.
    ///
    /// # Panics
    ///
    /// If the flash starts anything but a whole image.
    pub(super) fn started(&self) -> Option<&Image> {
        if self.flash[..8] == [ERASED; 8] {
            return None;
        }
        let mut images = self.images.iter();
        let whole = images.find(|image| self.flash.starts_with(&image.content));
        Some(whole.expect("the flash starts a part of an image"))
    }
}

/// A board on USB, and other chips that are in their loaders.
#[derive(Clone)]
pub(super) struct SimulatedBoard {
    pub(super) chip: Rc<RefCell<Chip>>,
    /// Ids of the loaders of other boards.
    pub(super) others: Vec<u32>,
    /// Whether a USB cable connects the loader.
    pub(super) has_cable: bool,
    /// Number of times that opening the loader fails, before udev permits it.
    pub(super) denials: u32,
    pub(super) notes: Vec<String>,
    /// Number of resets into the loader.
    pub(super) resets: u32,
}

impl SimulatedBoard {
    /// Creates a board that runs `image`.
    pub(super) fn new(image: &Image, layout: &'static str, transfer_size: u16) -> SimulatedBoard {
        let sectors = FlashLayout::parse(layout).unwrap();
        let mut flash = vec![0xA5; sectors.range().len()];
        flash[..image.content.len()].copy_from_slice(&image.content);
        SimulatedBoard {
            chip: Rc::new(RefCell::new(Chip {
                runs: Runs::Flash,
                flash,
                images: vec![image.clone()],
                requests_left: usize::MAX,
                refuses: None,
                defect: None,
                leaves_silently: false,
                layout,
                transfer_size,
                sectors,
                now: Duration::ZERO,
                state: IDLE,
                status: 0,
                pointer: 0,
                download: (0, Vec::new()),
                busy_until: Duration::ZERO,
            })),
            others: Vec::new(),
            has_cable: true,
            denials: 0,
            notes: Vec::new(),
            resets: 0,
        }
    }

    /// Starts the loader, as a reset with BOOT0 high does.
    pub(super) fn reset_into_loader(&mut self) {
        let mut chip = self.chip.borrow_mut();
        (chip.runs, chip.state, chip.requests_left) = (Runs::Loader, IDLE, usize::MAX);
        self.resets += 1;
    }
}

impl Machine for SimulatedBoard {
    type LoaderId = u32;
    type Loader = SimulatedBoard;

    fn identify(&mut self) -> Result<DeviceSummary, BridgeError> {
        let chip = self.chip.borrow();
        let image = chip.started().filter(|_| chip.runs == Runs::Flash);
        let (what, seconds) = ("to the identification request", 5);
        let image = image.ok_or(QueryError::NoAnswer { what, seconds })?;
        Ok(DeviceSummary {
            board: image.board.clone(),
            firmware: image.firmware.clone(),
            model: image.model.clone(),
            uid: "00".to_owned(),
            reset_cause: "power on".to_owned(),
            fault: String::new(),
        })
    }

    fn start_loader(&mut self) -> Result<(), BridgeError> {
        self.reset_into_loader();
        Ok(())
    }

    fn loaders(&mut self) -> io::Result<Vec<u32>> {
        let mut loaders = self.others.clone();
        if self.has_cable && self.chip.borrow().runs == Runs::Loader {
            loaders.push(self.resets);
        }
        Ok(loaders)
    }

    fn open(&mut self, id: u32) -> io::Result<SimulatedBoard> {
        assert_eq!(id, self.resets, "the loader of another board");
        if self.denials > 0 {
            self.denials -= 1;
            return Err(io::ErrorKind::PermissionDenied.into());
        }
        Ok(self.clone())
    }

    fn now(&self) -> Duration {
        self.chip.borrow().now
    }

    fn sleep(&mut self, time: Duration) {
        self.chip.borrow_mut().now += time;
    }

    fn note(&mut self, line: &str) {
        self.notes.push(line.to_owned());
    }
}

impl Loader for SimulatedBoard {
    fn send(&mut self, request: u8, value: u16, data: &[u8]) -> io::Result<()> {
        self.chip.borrow_mut().send(request, value, data)
    }

    fn receive(&mut self, request: u8, value: u16, length: u16) -> io::Result<Vec<u8>> {
        self.chip.borrow_mut().receive(request, value, length)
    }

    fn sleep(&mut self, time: Duration) {
        Machine::sleep(self, time);
    }

    fn layout(&self) -> &str {
        self.chip.borrow().layout
    }

    fn transfer_size(&self) -> u16 {
        self.chip.borrow().transfer_size
    }
}
