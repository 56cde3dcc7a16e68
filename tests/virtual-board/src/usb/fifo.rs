//! The core's FIFO memory: one receive FIFO, which all OUT endpoints share, and a transmit FIFO for
//! each IN endpoint; also a check of their positions and sizes.

use std::collections::VecDeque;

/// Kinds of status words in the receive FIFO, with the values of the field `PKTSTS` (RM0433 57.14,
/// `OTG_GRXSTSP` in device mode).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PacketStatus {
    GlobalOutNak = 1,
    OutData = 2,
    OutDone = 3,
    SetupDone = 4,
    SetupData = 6,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entry {
    Status(u32),
    Data(u32),
}

/// The receive FIFO, which holds, for each packet, a status word and then its data in words.
#[derive(Clone, Debug, Default)]
pub(super) struct RxFifo(VecDeque<Entry>);

impl RxFifo {
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the number of words in the FIFO.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns the number of words that a packet of `bytes` bytes needs: its status, its data, and
    /// the status that ends a transfer.
    pub(super) fn words_for(bytes: usize) -> usize {
        1 + bytes.div_ceil(4) + 1
    }

    /// Appends the status word of a packet and then the packet's bytes, if it has any.
    ///
    /// `data1` is true if the data PID is DATA1; `frame` is the number of the USB frame.
    pub(super) fn push(
        &mut self,
        status: PacketStatus,
        endpoint: usize,
        data1: bool,
        frame: u32,
        bytes: &[u8],
    ) {
        let endpoint = u32::try_from(endpoint & 0xF).unwrap_or_default();
        let count = u32::try_from(bytes.len() & 0x7FF).unwrap_or_default();
        let pid = if data1 { 0b10 } else { 0b00 };
        let word = endpoint | count << 4 | pid << 15 | (status as u32) << 17 | (frame & 0xF) << 21;
        self.0.push_back(Entry::Status(word));
        self.0.extend(bytes.chunks(4).map(|chunk| {
            let mut word = [0; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            Entry::Data(u32::from_le_bytes(word))
        }));
    }

    /// Returns the status word at the front; `None` if the front has data or the FIFO is empty.
    pub(super) fn peek_status(&self) -> Option<u32> {
        match self.0.front() {
            Some(&Entry::Status(word)) => Some(word),
            _ => None,
        }
    }

    /// Removes the status word at the front; `None` if the front has data or the FIFO is empty.
    pub(super) fn pop_status(&mut self) -> Option<u32> {
        let word = self.peek_status()?;
        self.0.pop_front();
        Some(word)
    }

    /// Removes the data word at the front; `None` if the FIFO is empty or a status word is at the
    /// front.
    pub(super) fn pop_data(&mut self) -> Option<u32> {
        match self.0.pop_front_if(|entry| matches!(entry, Entry::Data(_)))? {
            Entry::Status(word) | Entry::Data(word) => Some(word),
        }
    }
}

/// Position and size of a FIFO in the FIFO memory, in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    pub(super) start: u32,
    pub(super) depth: u32,
}

impl Extent {
    /// Decodes a value of `OTG_DIEPTXFx`: start in bits 15:0, depth in bits 31:16.
    pub(super) fn from_dieptxf(value: u32) -> Self {
        Self { start: value & 0xFFFF, depth: value >> 16 }
    }

    fn end(self) -> u32 {
        self.start + self.depth
    }

    fn overlaps(self, other: Self) -> bool {
        self.start < other.end() && other.start < self.end()
    }
}

/// Smallest permitted depth of a FIFO, in words (RM0433 57.14, `OTG_GRXFSIZ` and `OTG_DIEPTXFx`).
const MIN_DEPTH: u32 = 16;

/// Returns the first error in the positions and sizes of `fifos` in a memory of `words` words;
/// `None` if there is none.
pub(super) fn layout_error(fifos: &[(String, Extent)], words: u32) -> Option<String> {
    for (n, (name, extent)) in fifos.iter().enumerate() {
        if extent.depth < MIN_DEPTH {
            return Some(format!("{name} has {} words, fewer than 16", extent.depth));
        }
        if extent.end() > words {
            return Some(format!(
                "{name} ends at word {}, after the {words} words of the memory",
                extent.end()
            ));
        }
        let over = fifos[..n].iter().find(|(_, before)| before.overlaps(*extent));
        if let Some((other, _)) = over {
            return Some(format!("{name} overlaps {other}"));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fifos_that_overlap_or_end_outside_the_memory_are_named() {
        let layout = |extents: &[(u32, u32)]| {
            let named: Vec<_> = extents
                .iter()
                .enumerate()
                .map(|(n, &(start, depth))| (format!("FIFO {n}"), Extent { start, depth }))
                .collect();
            layout_error(&named, 320)
        };
        assert_eq!(layout(&[(0, 64), (64, 16), (80, 240)]), None);
        assert_eq!(layout(&[(0, 64), (63, 16)]).as_deref(), Some("FIFO 1 overlaps FIFO 0"));
        assert_eq!(
            layout(&[(0, 64), (310, 16)]).as_deref(),
            Some("FIFO 1 ends at word 326, after the 320 words of the memory")
        );
        assert_eq!(layout(&[(0, 15)]).as_deref(), Some("FIFO 0 has 15 words, fewer than 16"));
    }
}
