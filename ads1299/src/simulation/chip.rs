//! The digital side of a chip: what it understands and when.

use crate::command::opcode;
use crate::simulation::Fault;
use crate::{CHANNELS, CHIP_BYTES, Register};

/// A chip.
#[derive(Clone, Debug)]
pub(super) struct Chip {
    registers: [u8; Register::COUNT],
    /// Data at every DRDY; nothing but SDATAC is understood.
    continuous: bool,
    /// Before this time it understands nothing, ns.
    awake_ns: u64,
    /// Since when the reference has been on, ns.
    reference_ns: Option<u64>,
    pub(super) selected: bool,
    state: State,
    /// When the last byte ended, ns.
    last_ns: u64,
    /// What the last byte did, unless the chip is deselected too early.
    pending: Option<Pending>,
    pub(super) fault: Option<Fault>,
    /// Its bits of a frame.
    pub(super) frame: [u8; CHIP_BYTES],
}

/// Where it is in a command.
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
    /// Until it is deselected.
    Lost,
}

/// What a byte does four cycles after its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pending {
    Continuous(bool),
    Write(u8, u8),
}

/// What the board must know of a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Heard {
    Nothing,
    Opcode(u8),
    /// Too early.
    Violation,
}

/// The four cycles of tSDECODE in ns, and the time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) now_ns: u64,
    pub(super) decode_ns: u64,
}

impl Chip {
    /// Power on at time 0.
    pub(super) const fn new(awake_ns: u64) -> Self {
        Self {
            registers: Register::RESET,
            continuous: true,
            awake_ns,
            reference_ns: None,
            selected: false,
            state: State::Opcode,
            last_ns: 0,
            pending: None,
            fault: None,
            frame: [0; CHIP_BYTES],
        }
    }

    /// The end of a reset.
    pub(super) fn reset(&mut self, awake_ns: u64) {
        *self = Self {
            selected: self.selected,
            fault: self.fault,
            ..Self::new(awake_ns)
        };
    }

    /// Takes the counts of a conversion: status word and counts as bytes, for the next frame.
    pub(super) fn take(&mut self, counts: &[i32; CHANNELS]) {
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

    /// A register, as the chip acts by it.
    pub(super) const fn register(&self, register: Register) -> u8 {
        self.registers[register.index()]
    }

    /// Lead-off status.
    pub(super) fn set_lead_off(&mut self, [positive, negative]: [u8; 2]) {
        self.registers[Register::LOFF_STATP.index()] = positive;
        self.registers[Register::LOFF_STATN.index()] = negative;
    }

    /// How much of its 4.5 V the reference has, 0 to 1: a ramp of 150 ms, for want of better.
    #[expect(clippy::cast_precision_loss, reason = "hours in ns are exact")]
    pub(super) fn reference(&self, now_ns: u64) -> f64 {
        let since = self.reference_ns.map_or(0, |on| now_ns.saturating_sub(on));
        (since as f64 / 150e6).min(1.0)
    }

    /// Whether its registers are being read.
    pub(super) fn is_read(&self) -> bool {
        matches!(self.state, State::Read { .. }) && !self.is_dead()
    }

    pub(super) fn select(&mut self) {
        self.selected = true;
        self.state = State::Opcode;
        self.pending = None;
    }

    /// Whether the last byte had its time.
    pub(super) fn deselect(&mut self, moment: Moment) -> bool {
        self.selected = false;
        let in_time = moment.now_ns >= self.last_ns + moment.decode_ns;
        let Some(pending) = self.pending.take() else {
            return true;
        };
        if in_time {
            self.carry_out(pending, moment);
        }
        in_time
    }

    /// The byte that it sends while it receives the next one, unless it sends samples.
    pub(super) fn output(&self) -> u8 {
        match self.state {
            State::Read { at, .. } => match (at, self.fault) {
                (0, Some(Fault::WrongId(id))) => id,
                (at, _) => self.registers.get(usize::from(at)).copied().unwrap_or(0),
            },
            _ => 0,
        }
    }

    /// Whether a zero says nothing to it: it waits for an opcode, and a zero is none.
    pub(super) fn ignores_null_bytes(&self, moment: Moment) -> bool {
        let waits = self.state == State::Opcode && self.pending.is_none();
        waits && (self.continuous || self.is_dead()) && moment.now_ns >= self.awake_ns
    }

    /// A byte that ends now.
    pub(super) fn receive(&mut self, byte: u8, moment: Moment) -> Heard {
        if self.is_dead() {
            return Heard::Nothing;
        }
        if moment.now_ns < self.awake_ns {
            return if byte == 0 {
                Heard::Nothing
            } else {
                Heard::Violation
            };
        }
        let too_early = moment.now_ns < self.last_ns + moment.decode_ns;
        self.last_ns = moment.now_ns;
        if too_early && self.state != State::Opcode && self.state != State::Lost {
            self.state = State::Lost;
            self.pending = None;
            return Heard::Violation;
        }
        if let Some(pending) = self.pending.take() {
            self.carry_out(pending, moment);
        }
        match self.state {
            State::Opcode => return self.understand(byte),
            State::Count { write, first } => {
                let (at, left) = (first, (byte & 0x1F) + 1);
                self.state = if write {
                    State::Write { at, left }
                } else {
                    State::Read { at, left }
                };
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
        Heard::Nothing
    }

    fn understand(&mut self, byte: u8) -> Heard {
        match byte {
            opcode::SDATAC => self.pending = Some(Pending::Continuous(false)),
            _ if self.continuous => return Heard::Nothing,
            opcode::RDATAC => self.pending = Some(Pending::Continuous(true)),
            _ => {
                let first = byte & !opcode::MASK;
                let write = byte & opcode::MASK == opcode::WREG;
                if !write && byte & opcode::MASK != opcode::RREG {
                    return Heard::Nothing;
                }
                self.state = State::Count { write, first };
            }
        }
        Heard::Opcode(byte)
    }

    fn carry_out(&mut self, pending: Pending, moment: Moment) {
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

/// The state while something is left to do.
fn rest(left: u8, state: State) -> State {
    if left == 0 { State::Opcode } else { state }
}
