//! Digital part of a simulated chip: command decoder and registers.

use crate::chain::opcode;
use crate::decoder::{CHANNELS, CHIP_BYTES, MAX_CHIPS};
use crate::register::Register;
use crate::simulation::options::Fault;

/// Registers, command decoder and output data of a simulated chip.
#[derive(Clone, Debug)]
pub(super) struct Chip {
    registers: [u8; Register::COUNT],
    /// True in RDATAC mode: the chip sends data after every DRDY and accepts only SDATAC.
    continuous: bool,
    /// Time before which no command is accepted, in nanoseconds.
    awake_ns: u64,
    /// False from power-on to the first reset: until then, only SDATAC and RESET are accepted.
    was_reset: bool,
    /// Time at which the reference was switched on, in nanoseconds; `None` while it is off.
    reference_ns: Option<u64>,
    pub(super) selected: bool,
    state: State,
    /// Time at which the last received byte ended, in nanoseconds.
    last_ns: u64,
    /// Effect of the last byte; cancelled if the chip is deselected before the byte is decoded.
    pending: Option<Pending>,
    pub(super) fault: Option<Fault>,
    /// Status word and counts of the last conversion.
    pub(super) frame: [u8; CHIP_BYTES],
}

/// State of the command decoder: what the next byte means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Opcode,
    Count {
        write: bool,
        first: u8,
    },
    Read {
        at: u8,
        left: u8,
    },
    Write {
        at: u8,
        left: u8,
    },
    /// A timing rule was violated: bytes have no effect until the chip is deselected.
    Lost,
}

/// Effect of a received byte; it occurs four clock cycles after the end of the byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pending {
    Continuous(bool),
    Write(u8, u8),
}

/// Result of receiving a byte, for the board's log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Received {
    Nothing,
    Opcode(u8),
    /// The byte came before the previous one was decoded, or before the end of a reset.
    Violation,
}

/// Current time, and the duration of tSDECODE (four clock cycles), both in nanoseconds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) now_ns: u64,
    pub(super) decode_ns: u64,
}

impl Chip {
    /// Creates a chip that accepts no command before `awake_ns`.
    pub(super) const fn new(awake_ns: u64) -> Self {
        Self {
            registers: Register::RESET,
            continuous: true,
            awake_ns,
            was_reset: false,
            reference_ns: None,
            selected: false,
            state: State::Opcode,
            last_ns: 0,
            pending: None,
            fault: None,
            frame: [0; CHIP_BYTES],
        }
    }

    /// Resets the chip; it accepts no command before `awake_ns`.
    pub(super) fn reset(&mut self, awake_ns: u64) {
        *self = Self {
            selected: self.selected,
            fault: self.fault,
            was_reset: true,
            ..Self::new(awake_ns)
        };
    }

    /// Switches the supply on: the chip accepts no command before `awake_ns`, and then only SDATAC
    /// and RESET until a reset.
    pub(super) fn power_on(&mut self, awake_ns: u64) {
        self.reset(awake_ns);
        self.was_reset = false;
    }

    /// Stores the counts of a conversion, with the status word, as the next frame.
    pub(super) fn store_conversion(&mut self, counts: &[i32; CHANNELS]) {
        let nibble = match self.fault {
            Some(Fault::StuckData) => return,
            Some(Fault::WrongNibble(nibble)) => u32::from(nibble & 0xF),
            _ => 0b1100,
        };
        let status = nibble << 20
            | u32::from(self.register(Register::LOFF_STATP)) << 12
            | u32::from(self.register(Register::LOFF_STATN)) << 4
            | u32::from(self.register(Register::GPIO) >> 4);
        let words = [status].into_iter().chain(counts.map(i32::cast_unsigned));
        for (place, word) in self.frame.chunks_exact_mut(3).zip(words) {
            place.copy_from_slice(&word.to_be_bytes()[1..]);
        }
    }

    pub(super) fn is_dead(&self) -> bool {
        self.fault == Some(Fault::Dead)
    }

    pub(super) const fn is_continuous(&self) -> bool {
        self.continuous
    }

    /// Returns a register's value; a write that the chip is still decoding has no effect yet.
    pub(super) const fn register(&self, register: Register) -> u8 {
        self.registers[register.index()]
    }

    /// Sets the lead-off status: the disconnected inputs in `off` that have a lead-off current, or
    /// 0 while the comparators are off.
    pub(super) fn set_lead_off(&mut self, off: u8) {
        let has_comparators = self.register(Register::CONFIG4) & 2 != 0;
        let status = off & self.register(Register::LOFF_SENSP);
        self.registers[Register::LOFF_STATP.index()] = if has_comparators { status } else { 0 };
    }

    /// Returns the reference voltage as a fraction of 4.5 V. The simulated voltage rises as a ramp
    /// of 150 ms, because the data sheet states only that settling time.
    #[expect(clippy::cast_precision_loss, reason = "hours in ns are exact")]
    pub(super) fn reference(&self, now_ns: u64) -> f64 {
        let since = self.reference_ns.map_or(0, |on| now_ns.saturating_sub(on));
        (since as f64 / 150e6).min(1.0)
    }

    pub(super) fn select(&mut self) {
        self.selected = true;
        self.state = State::Opcode;
        self.pending = None;
    }

    /// Deselects the chip; returns whether the chip had already decoded the last byte.
    pub(super) fn deselect(&mut self, moment: Moment) -> bool {
        self.selected = false;
        let in_time = moment.now_ns >= self.last_ns + moment.decode_ns;
        let Some(pending) = self.pending.take() else {
            return true;
        };
        if in_time {
            self.execute(pending, moment);
        }
        in_time
    }

    /// Returns the byte on DOUT during the next transfer, outside of RDATAC mode.
    pub(super) fn output(&self) -> u8 {
        match self.state {
            State::Read { at, .. } => match (at, self.fault) {
                (0, Some(Fault::WrongId(id))) => id,
                (at, _) => self.registers.get(usize::from(at)).copied().unwrap_or(0),
            },
            _ => 0,
        }
    }

    /// Returns true if a zero byte surely has no effect: the chip is dead or in RDATAC mode, and
    /// expects an opcode, which 0 is not.
    pub(super) fn ignores_null_bytes(&self, moment: Moment) -> bool {
        let waits = self.state == State::Opcode && self.pending.is_none();
        waits && (self.continuous || self.is_dead()) && moment.now_ns >= self.awake_ns
    }

    /// Receives a byte that ends at the time in `moment`.
    pub(super) fn receive(&mut self, byte: u8, moment: Moment) -> Received {
        if self.is_dead() {
            return Received::Nothing;
        }
        if moment.now_ns < self.awake_ns {
            return if byte == 0 { Received::Nothing } else { Received::Violation };
        }
        let too_early = moment.now_ns < self.last_ns + moment.decode_ns;
        self.last_ns = moment.now_ns;
        if too_early && self.state != State::Opcode && self.state != State::Lost {
            self.state = State::Lost;
            self.pending = None;
            return Received::Violation;
        }
        if let Some(pending) = self.pending.take() {
            self.execute(pending, moment);
        }
        match self.state {
            State::Opcode => return self.decode_opcode(byte),
            State::Count { write, first } => {
                let (at, left) = (first, (byte & 0x1F) + 1);
                self.state =
                    if write { State::Write { at, left } } else { State::Read { at, left } };
            }
            State::Read { at, left } => {
                let (at, left) = (at + 1, left - 1);
                self.state = rest(left, State::Read { at, left });
            }
            State::Write { at, left } => {
                self.pending = Some(Pending::Write(at, byte));
                let (at, left) = (at + 1, left - 1);
                self.state = rest(left, State::Write { at, left });
            }
            State::Lost => {}
        }
        Received::Nothing
    }

    fn decode_opcode(&mut self, byte: u8) -> Received {
        if !self.was_reset && ![0, opcode::SDATAC, opcode::RESET].contains(&byte) {
            return Received::Violation;
        }
        match byte {
            opcode::SDATAC => self.pending = Some(Pending::Continuous(false)),
            _ if self.continuous => return Received::Nothing,
            opcode::RDATAC => self.pending = Some(Pending::Continuous(true)),
            opcode::RESET | opcode::START | opcode::STOP => {}
            _ => {
                let first = byte & !opcode::MASK;
                let write = byte & opcode::MASK == opcode::WREG;
                if !write && byte & opcode::MASK != opcode::RREG {
                    return Received::Nothing;
                }
                self.state = State::Count { write, first };
            }
        }
        Received::Opcode(byte)
    }

    fn execute(&mut self, pending: Pending, moment: Moment) {
        match pending {
            Pending::Continuous(continuous) => self.continuous = continuous,
            Pending::Write(address, value) => self.write(address, value, moment.now_ns),
        }
    }

    fn write(&mut self, address: u8, value: u8, now_ns: u64) {
        let Some(register) = Register::at(address) else {
            return;
        };
        let read_only = [Register::ID, Register::LOFF_STATP, Register::LOFF_STATN];
        if read_only.contains(&register) || self.fault == Some(Fault::Forgets(register)) {
            return;
        }
        self.registers[register.index()] = value;
        if register == Register::CONFIG3 {
            let on = value & 0x80 != 0;
            self.reference_ns = on.then(|| self.reference_ns.unwrap_or(now_ns));
        }
    }
}

/// Returns `state` if the command has registers left, else the state that expects an opcode.
fn rest(left: u8, state: State) -> State {
    if left == 0 { State::Opcode } else { state }
}

/// Length of the longest burst in bytes: eight chips, a don't-care bit per chip, and the bit that
/// `Fault::ShiftedBit` inserts.
const BYTES: usize = CHIP_BYTES * MAX_CHIPS + 2;

/// The bits that a chain sends for one sample, starting with the first selected chip.
pub(super) struct Burst([u8; BYTES]);

impl Burst {
    /// Builds the burst with `spaced` (0 or 1) don't-care bits between chips.
    pub(super) fn new(chips: &[Chip], spaced: usize) -> Self {
        let mut burst = Self([0; BYTES]);
        let mut place = 0;
        let mut was_late = false;
        // A chip that is dead or not selected blocks the chips after it.
        let chips = chips.iter().take_while(|chip| chip.selected && !chip.is_dead());
        for (index, chip) in chips.enumerate() {
            if chip.fault == Some(Fault::ShiftedBit) && !was_late {
                was_late = true;
                place += 1;
            }
            for byte in chip.frame {
                burst.put(place, byte);
                place += 8;
            }
            if spaced > 0 && index.is_multiple_of(2) {
                burst.put(place, 0x80);
            }
            place += spaced;
        }
        burst
    }

    /// ORs eight bits into the burst at bit position `place`.
    fn put(&mut self, place: usize, bits: u8) {
        let both = u16::from(bits) << (8 - place % 8);
        let [first, second] = both.to_be_bytes();
        if let Some(byte) = self.0.get_mut(place / 8) {
            *byte |= first;
        }
        if let Some(byte) = self.0.get_mut(place / 8 + 1) {
            *byte |= second;
        }
    }

    /// Returns byte `n`; 0 after the end.
    pub(super) fn byte(&self, n: usize) -> u8 {
        self.0.get(n).copied().unwrap_or(0)
    }
}
