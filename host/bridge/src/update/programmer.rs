//! Programs a chip's flash through a DfuSe loader (AN3156), which extends DFU 1.1.

use std::io;
use std::ops::Range;
use std::time::Duration;

use dfuse::Image;
use indicatif::ProgressBar;

use crate::update::UpdateError;
use crate::update::flash_layout::FlashLayout;

/// A loader in a chip's ROM, and a clock to wait with.
pub(crate) trait Loader {
    /// Sends a request of the DFU class with its data.
    fn send(&mut self, request: u8, value: u16, data: &[u8]) -> io::Result<()>;

    /// Sends a request of the DFU class, and returns at most `length` bytes of its answer.
    fn receive(&mut self, request: u8, value: u16, length: u16) -> io::Result<Vec<u8>>;

    /// Waits for the time that the loader has asked for.
    fn sleep(&mut self, time: Duration);

    /// Returns the loader's description of its flash.
    fn layout(&self) -> &str;

    /// Returns the largest number of bytes in one request, wTransferSize.
    fn transfer_size(&self) -> u16;
}

/// Requests of the DFU class (DFU 1.1, table 3.2).
pub(crate) const DNLOAD: u8 = 1;
pub(crate) const UPLOAD: u8 = 2;
pub(crate) const GET_STATUS: u8 = 3;
pub(crate) const CLEAR_STATUS: u8 = 4;
pub(crate) const ABORT: u8 = 6;

/// States of a loader (DFU 1.1, section 6.1.2).
pub(crate) const IDLE: u8 = 2;
pub(crate) const DOWNLOAD_BUSY: u8 = 4;
pub(crate) const DOWNLOAD_IDLE: u8 = 5;
pub(crate) const ERROR: u8 = 10;

/// First byte of a DfuSe command, which is sent as a download to block 0 (AN3156, section 5).
pub(crate) const SET_ADDRESS: u8 = 0x21;
pub(crate) const ERASE: u8 = 0x41;
/// Block number that stands for the address set with [`SET_ADDRESS`].
const FIRST_BLOCK: u16 = 2;

/// Bytes that the STM32H743 programs at once: a flash word of 256 bits (RM0433, embedded flash).
pub(crate) const FLASH_WORD: usize = 32;
/// Content of erased flash.
pub(crate) const ERASED: u8 = 0xFF;

/// Time limit for one command. Erasing a sector takes the longest: some seconds by the chips' data
/// sheets.
const COMMAND_TIMEOUT: Duration = Duration::from_secs(20);

/// Erases the sectors that an image takes, writes and compares the image, and lets the loader start
/// it. Advances `bar` by the bytes that are erased, written and compared.
///
/// The sector with the vector table is erased first, and the block with the vector table is written
/// last, after all others were compared. So a chip starts either a whole image or none.
///
/// # Errors
///
/// [`UpdateError::Lost`], [`UpdateError::Refused`] or [`UpdateError::Differs`]. After each of them,
/// programming again is safe.
pub(crate) fn program(
    loader: &mut impl Loader,
    layout: &FlashLayout,
    image: &Image,
    bar: &ProgressBar,
) -> Result<(), UpdateError> {
    let mut content = image.content.clone();
    content.resize(content.len().next_multiple_of(FLASH_WORD), ERASED);
    let block_size = usize::from(loader.transfer_size()) / FLASH_WORD * FLASH_WORD;
    let block_size = block_size.max(FLASH_WORD);
    let blocks = content.chunks(block_size);
    let mut blocks: Vec<_> = (image.address..).step_by(block_size).zip(blocks).collect();
    let end = blocks.last().map_or(image.address, |(address, block)| {
        address + u32::try_from(block.len()).unwrap_or(0)
    });
    let is_taken = |sector: &&Range<u32>| sector.start < end && image.address < sector.end;
    let sectors: Vec<_> = layout.sectors.iter().filter(is_taken).collect();
    let to_erase: usize = sectors.iter().map(|sector| sector.len()).sum();
    bar.set_length((to_erase + 2 * content.len()) as u64);
    let mut programmer = Programmer { loader, doing: "starting" };
    programmer.become_idle()?;
    programmer.enter("erasing", bar);
    for sector in sectors {
        programmer.command(ERASE, sector.start)?;
        bar.inc(sector.len() as u64);
    }
    let others = blocks.split_off(blocks.len().min(1));
    for blocks in [others, blocks] {
        programmer.enter("writing", bar);
        for (address, block) in &blocks {
            programmer.command(SET_ADDRESS, *address)?;
            programmer.download(FIRST_BLOCK, block)?;
            bar.inc(block.len() as u64);
        }
        programmer.enter("comparing", bar);
        for (address, block) in &blocks {
            programmer.compare(*address, block)?;
            bar.inc(block.len() as u64);
        }
    }
    programmer.enter("starting the image", bar);
    programmer.leave(image.address)
}

struct Programmer<'l, L> {
    loader: &'l mut L,
    /// What the programmer is doing, for error messages.
    doing: &'static str,
}

/// Answer to [`GET_STATUS`] (DFU 1.1, section 6.1.2).
struct StatusReport {
    /// Field bStatus; 0 without an error.
    code: u8,
    /// Time to wait before the next request.
    wait: Duration,
    state: u8,
}

impl<L: Loader> Programmer<'_, L> {
    fn enter(&mut self, doing: &'static str, bar: &ProgressBar) {
        self.doing = doing;
        bar.set_message(doing);
    }

    fn lost(&self, source: io::Error) -> UpdateError {
        let doing = self.doing;
        UpdateError::Lost { doing, source }
    }

    fn send(&mut self, request: u8, value: u16, data: &[u8]) -> Result<(), UpdateError> {
        let sent = self.loader.send(request, value, data);
        sent.map_err(|error| self.lost(error))
    }

    fn status(&mut self) -> Result<StatusReport, UpdateError> {
        let answer = self.loader.receive(GET_STATUS, 0, 6);
        let answer = answer.map_err(|error| self.lost(error))?;
        let [code, low, middle, high, state, _] = answer[..] else {
            return Err(self.lost(io::ErrorKind::UnexpectedEof.into()));
        };
        let wait = u32::from_le_bytes([low, middle, high, 0]);
        let wait = Duration::from_millis(wait.into()).min(COMMAND_TIMEOUT);
        Ok(StatusReport { code, wait, state })
    }

    /// Brings the loader to its idle state, from whatever state an interrupted update has left.
    fn become_idle(&mut self) -> Result<(), UpdateError> {
        for _ in 0..6 {
            let StatusReport { wait, state, .. } = self.status()?;
            match state {
                IDLE => return Ok(()),
                DOWNLOAD_BUSY => self.loader.sleep(wait),
                ERROR => self.send(CLEAR_STATUS, 0, &[])?,
                _ => self.send(ABORT, 0, &[])?,
            }
        }
        Err(self.lost(io::Error::other("it does not become idle")))
    }

    fn command(&mut self, command: u8, address: u32) -> Result<(), UpdateError> {
        let [a, b, c, d] = address.to_le_bytes();
        self.download(0, &[command, a, b, c, d])
    }

    /// Downloads a command or a block, and waits until the loader has carried it out.
    fn download(&mut self, block: u16, data: &[u8]) -> Result<(), UpdateError> {
        self.send(DNLOAD, block, data)?;
        let mut waited = Duration::ZERO;
        loop {
            // The first of these status requests makes the loader start the command.
            let StatusReport { code, wait, state } = self.status()?;
            match state {
                DOWNLOAD_IDLE => return Ok(()),
                DOWNLOAD_BUSY if waited <= COMMAND_TIMEOUT => {
                    let wait = wait.max(Duration::from_millis(1));
                    self.loader.sleep(wait);
                    waited += wait;
                }
                _ if code != 0 => {
                    return Err(UpdateError::Refused { doing: self.doing, status: code });
                }
                _ => return Err(self.lost(io::ErrorKind::TimedOut.into())),
            }
        }
    }

    fn compare(&mut self, address: u32, block: &[u8]) -> Result<(), UpdateError> {
        self.command(SET_ADDRESS, address)?;
        self.become_idle()?;
        let length = u16::try_from(block.len()).unwrap_or(u16::MAX);
        let read = self.loader.receive(UPLOAD, FIRST_BLOCK, length);
        let read = read.map_err(|error| self.lost(error))?;
        let equal = read.iter().zip(block).take_while(|(is, was)| is == was);
        let equal = equal.count();
        if equal < block.len() {
            let address = address + u32::try_from(equal).unwrap_or(0);
            return Err(UpdateError::Differs { address });
        }
        self.become_idle()
    }

    /// Lets the loader start the image at `address`. Ignores the answer to the last request,
    /// because the loader may end before it answers.
    fn leave(&mut self, address: u32) -> Result<(), UpdateError> {
        self.command(SET_ADDRESS, address)?;
        self.send(DNLOAD, FIRST_BLOCK, &[])?;
        let _ = self.status();
        Ok(())
    }
}
