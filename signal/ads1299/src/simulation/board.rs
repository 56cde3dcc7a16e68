//! Simulated board: the chips, the wires between them, and virtual time.

use std::vec::Vec;

use crate::bus::Speed;
use crate::chain::{AFTER_RESET, DECODE, POWER_ON, RESET_LOW, opcode};
use crate::decoder::CHANNELS;
use crate::register::Register;
use crate::settings::{Rate, Wiring};
use crate::simulation::analogue::{self, Contacts, Conversion, Electrode, Noise};
use crate::simulation::chip::{Burst, Chip, Moment, Received};
use crate::simulation::miso::Miso;
use crate::simulation::options::{Electrodes, Fault, Options};

/// Entry in the log of the wires between the driver and the chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// RESET went high, which ends a reset.
    Reset,
    /// START changed to this level; true is high.
    Start(bool),
    /// A chip received an opcode.
    Command {
        /// Index of the chip; chip 0 is wired to MISO.
        chip: usize,
        /// Opcode; RREG and WREG include the first register's address.
        opcode: u8,
    },
}

/// Chips, levels of the wires, virtual time, and the log of the wires.
pub(super) struct Board<const CHIPS: usize> {
    options: Options,
    /// Time at which the supplies came on, in nanoseconds; `None` while they are off: then no chip
    /// answers, whatever the levels of the pins.
    powered_ns: Option<u64>,
    pub(super) speed: Speed,
    /// Duration of tSDECODE, in nanoseconds.
    decode_ns: u64,
    miso: Miso,
    pub(super) now_ns: u64,
    chips: [Chip; CHIPS],
    electrodes: Electrodes<CHIPS>,
    /// Number of samples taken from the electrodes' signal source.
    pub(super) delivered: u64,
    contacts: [Contacts; CHIPS],
    noise: Noise,
    start: bool,
    /// True after the opcode START, until STOP.
    is_commanded: bool,
    /// Time at which RESET went low, in nanoseconds; `None` while it is high.
    reset_low_ns: Option<u64>,
    /// Time at which the next conversion ends, in clock cycles; `None` while the chips are stopped.
    next: Option<u64>,
    /// Time at which the next conversion ends, in nanoseconds; `u64::MAX` while the chips are
    /// stopped.
    next_ns: u64,
    /// Number of bytes clocked since the last conversion or, with cascaded chips, since the last
    /// change of a chip select.
    clocked: usize,
    /// Bits that the chain sends for the current sample; built when its first byte is transferred.
    burst: Option<Burst>,
    /// Cached result of [`Self::ignores_null_bytes`]; `None` if it must be computed again.
    is_deaf: Option<bool>,
    /// Number of falling edges of DRDY, without edges that a fault suppressed.
    pub(super) edges: u64,
    pub(super) violations: u32,
    pub(super) events: Vec<(u64, Event)>,
}

impl<const CHIPS: usize> Board<CHIPS> {
    pub(super) fn new(options: Options, electrodes: Electrodes<CHIPS>) -> Self {
        let mut board = Self {
            options,
            powered_ns: Some(0),
            speed: Speed::Registers,
            decode_ns: 0,
            miso: Miso::default(),
            now_ns: 0,
            chips: core::array::from_fn(|_| Chip::new(u64::MAX)),
            electrodes,
            delivered: 0,
            contacts: [Contacts::IDEAL; CHIPS],
            noise: Noise::new(options.seed),
            start: false,
            is_commanded: false,
            reset_low_ns: None,
            next: None,
            next_ns: u64::MAX,
            clocked: 0,
            burst: None,
            is_deaf: None,
            edges: 0,
            violations: 0,
            events: Vec::new(),
        };
        board.decode_ns = board.nanoseconds(u64::from(DECODE));
        board.wake_chips();
        board
    }

    pub(super) fn set_fault(&mut self, chip: usize, fault: Option<Fault>) {
        self.burst = None;
        self.is_deaf = None;
        if let Some(chip) = self.chips.get_mut(chip) {
            chip.fault = fault;
        }
    }

    pub(super) fn set_electrode(&mut self, chip: usize, channel: usize, on: bool) {
        if channel < CHANNELS
            && let Some(contacts) = self.contacts.get_mut(chip)
        {
            contacts.off = contacts.off & !(1 << channel) | u8::from(!on) << channel;
        }
    }

    pub(super) fn set_impedance(&mut self, chip: usize, channel: usize, ohms: f64) {
        let contacts = self.contacts.get_mut(chip);
        if let Some(place) = contacts.and_then(|contacts| contacts.ohms.get_mut(channel)) {
            *place = ohms;
        }
    }

    pub(super) fn set_select(&mut self, chip: usize, high: bool) {
        let moment = self.moment();
        self.burst = None;
        self.is_deaf = None;
        if self.options.wiring == Wiring::Cascaded {
            self.clocked = 0;
        }
        let config1 = self.chips[0].register(Register::CONFIG1);
        let Some(chip) = self.chips.get_mut(chip) else {
            return;
        };
        match (chip.selected, high) {
            (false, false) => chip.select(),
            (true, true) if !chip.deselect(moment) => self.violations += 1,
            _ => {}
        }
        self.restart_filter(config1);
    }

    /// Restarts the digital filter if CONFIG1 differs from `before` (data sheet section 9.4.2).
    fn restart_filter(&mut self, before: u8) {
        let changed = self.chips[0].register(Register::CONFIG1) != before;
        if changed && self.next.is_some() {
            self.convert_at(Some(self.cycles() + u64::from(self.rate().settling())));
        }
    }

    pub(super) fn set_start(&mut self, high: bool) {
        if high != self.start {
            self.start = high;
            self.note(Event::Start(high));
            self.start_or_stop();
        }
    }

    /// Starts the conversions if the supplies are on, and the pin START is high or the opcode START
    /// is in effect; stops them otherwise.
    fn start_or_stop(&mut self) {
        let converts = (self.start || self.is_commanded) && self.powered_ns.is_some();
        let settled = self.cycles() + u64::from(self.rate().settling());
        self.convert_at(converts.then_some(settled));
    }

    /// Executes an opcode that a chip has received. START and STOP take effect at chip 0 only,
    /// because only its DRDY is wired.
    fn execute(&mut self, index: usize, code: u8) {
        match (index, code) {
            (0, opcode::START | opcode::STOP) => {
                self.is_commanded = code == opcode::START;
                self.start_or_stop();
            }
            (_, opcode::RESET) => {
                let ready_ns = self.nanoseconds(u64::from(POWER_ON));
                let in_time = self.powered_ns.is_some_and(|on| self.now_ns >= on + ready_ns);
                self.violations += u32::from(!in_time);
                let awake_ns = self.now_ns + self.nanoseconds(u64::from(AFTER_RESET));
                self.chips[index].reset(awake_ns);
            }
            _ => {}
        }
    }

    pub(super) fn set_reset(&mut self, high: bool) {
        self.is_deaf = None;
        match (high, self.reset_low_ns) {
            (false, None) => self.reset_low_ns = Some(self.now_ns),
            (true, Some(since)) => {
                self.reset_low_ns = None;
                self.note(Event::Reset);
                let Some(powered_ns) = self.powered_ns else {
                    return;
                };
                let in_time = since >= powered_ns + self.nanoseconds(u64::from(POWER_ON))
                    && self.now_ns - since >= self.nanoseconds(u64::from(RESET_LOW));
                self.violations += u32::from(!in_time);
                let awake_ns = self.now_ns + self.nanoseconds(u64::from(AFTER_RESET));
                if in_time {
                    self.chips.iter_mut().for_each(|chip| chip.reset(awake_ns));
                }
            }
            _ => {}
        }
    }

    /// Transfers a byte now, at the configured speed.
    pub(super) fn transfer(&mut self, byte: u8) -> u8 {
        let sclk_hz = match self.speed {
            Speed::Registers => self.options.register_hz,
            Speed::Bursts => self.options.burst_hz,
        };
        let byte_ns = 8_000_000_000 / u64::from(sclk_hz);
        self.clock_byte(byte, self.now_ns + byte_ns, sclk_hz)
    }

    /// Transfers a byte that ends at `end_ns`, at an SCLK of `sclk_hz`; returns the byte on MISO.
    pub(super) fn clock_byte(&mut self, byte: u8, end_ns: u64, sclk_hz: u32) -> u8 {
        let answer = self.output(sclk_hz);
        self.clocked += 1;
        self.advance(end_ns);
        if self.powered_ns.is_none() {
            return answer;
        }
        let moment = self.moment();
        if byte == 0 && self.ignores_null_bytes(moment) {
            return answer;
        }
        self.is_deaf = None;
        for index in 0..CHIPS {
            let chip = &mut self.chips[index];
            if !chip.selected {
                continue;
            }
            match chip.receive(byte, moment) {
                Received::Nothing => {}
                Received::Violation => self.violations += 1,
                Received::Opcode(opcode) => {
                    self.note(Event::Command { chip: index, opcode });
                    self.execute(index, opcode);
                }
            }
        }
        answer
    }

    /// Returns whether all selected chips ignore a zero byte, as they do in a burst.
    fn ignores_null_bytes(&mut self, moment: Moment) -> bool {
        let mut selected = self.chips.iter().filter(|chip| chip.selected);
        let check = || selected.all(|chip| chip.ignores_null_bytes(moment));
        *self.is_deaf.get_or_insert_with(check)
    }

    /// Returns the byte on MISO during the next transfer.
    fn output(&mut self, sclk_hz: u32) -> u8 {
        let Some(first) = self.chips.iter().position(|chip| chip.selected) else {
            return 0xFF;
        };
        if self.options.wiring == Wiring::Cascaded {
            let selected = self.chips.iter().filter(|chip| chip.selected).count();
            self.violations += u32::from(selected > 1);
            return self.answer(first, 1);
        }
        let answer = self.answer(first, CHIPS - first);
        if first == 0 {
            self.miso.drive(answer & 1 == 1);
            return answer;
        }
        let Some(ohms) = self.options.read_back_ohms else {
            return 0xFF;
        };
        #[expect(clippy::cast_precision_loss, reason = "at most 8 chips")]
        let others = (CHIPS - 2) as f64;
        self.miso.read(answer, f64::from(ohms), others, sclk_hz)
    }

    /// Returns the byte at the DOUT of chip `first`, through which `chips` chips send their
    /// samples.
    fn answer(&mut self, first: usize, chips: usize) -> u8 {
        let chip = &self.chips[first];
        if chip.is_dead() || self.powered_ns.is_none() {
            return 0;
        }
        if !chip.is_continuous() {
            return chip.output();
        }
        let spaced = self.options.alignment as usize;
        let chain = &self.chips[first..first + chips];
        let burst = self.burst.get_or_insert_with(|| Burst::new(chain, spaced));
        burst.byte(self.clocked)
    }

    /// Advances time to `to_ns` and performs every conversion that ends by then.
    pub(super) fn advance(&mut self, to_ns: u64) {
        while let Some(next) = self.next
            && self.next_ns <= to_ns
        {
            self.now_ns = self.next_ns;
            self.convert(next);
            let mut period = u64::from(self.rate().divider());
            if self.chips[0].fault == Some(Fault::DoubleRate) {
                period /= 2;
            }
            self.convert_at(Some(next + period));
        }
        self.now_ns = self.now_ns.max(to_ns);
    }

    /// Advances time to the next edge of DRDY or to `limit_ns`; returns whether there was an edge.
    pub(super) fn advance_to_edge_until(&mut self, limit_ns: u64) -> bool {
        let before = self.edges;
        while self.edges == before {
            if self.next_ns > limit_ns {
                self.advance(limit_ns);
                return false;
            }
            self.advance(self.next_ns);
        }
        true
    }

    /// Returns the time at which the next conversion ends, in nanoseconds; `None` if the chips do
    /// not convert.
    pub(super) fn next_ns(&self) -> Option<u64> {
        self.next.map(|_| self.next_ns)
    }

    fn convert_at(&mut self, cycles: Option<u64>) {
        self.next = cycles;
        self.next_ns = cycles.map_or(u64::MAX, |cycles| self.nanoseconds(cycles));
    }

    /// Ends a conversion: stores new frames in all chips and sets DRDY low.
    fn convert(&mut self, cycles: u64) {
        let conversion = Conversion { now_ns: self.now_ns, cycles, rate: self.rate() };
        let electrodes = self.deliver();
        for (index, chip) in self.chips.iter_mut().enumerate() {
            chip.set_lead_off(self.contacts[index].off);
            let counts = analogue::convert(
                chip,
                &electrodes[index],
                &self.contacts[index],
                conversion,
                &mut self.noise,
            );
            chip.store_conversion(&counts);
        }
        self.clocked = 0;
        self.burst = None;
        if self.chips[0].fault == Some(Fault::MissedReady) {
            self.chips[0].fault = None;
        } else if !self.chips[0].is_dead() {
            self.edges += 1;
        }
    }

    /// Returns the next sample from the electrodes. If no channel converts its electrodes, returns
    /// 0 V and counts no sample.
    fn deliver(&mut self) -> [[Electrode; CHANNELS]; CHIPS] {
        let is_converted =
            |chip: &Chip| (0..CHANNELS).any(|n| analogue::converts_electrodes(chip, n));
        if !self.chips.iter().any(is_converted) {
            return [[Electrode::Volts(0.0); CHANNELS]; CHIPS];
        }
        let number = self.delivered;
        self.delivered += 1;
        match &mut self.electrodes {
            Electrodes::Volts(deliver) => {
                let mut volts = [[0.0; CHANNELS]; CHIPS];
                deliver(number, &mut volts);
                volts.map(|chip| chip.map(Electrode::Volts))
            }
            Electrodes::Counts(deliver) => {
                let mut counts = [[0; CHANNELS]; CHIPS];
                deliver(number, &mut counts);
                counts.map(|chip| chip.map(Electrode::Counts))
            }
        }
    }

    /// Returns the sample rate in chip 0's CONFIG1, which the simulation uses for all chips.
    fn rate(&self) -> Rate {
        analogue::rate(self.chips[0].register(Register::CONFIG1))
    }

    fn moment(&self) -> Moment {
        Moment { now_ns: self.now_ns, decode_ns: self.decode_ns }
    }

    /// Returns the current time in clock cycles, rounded up.
    #[expect(clippy::cast_possible_truncation, reason = "centuries")]
    fn cycles(&self) -> u64 {
        (u128::from(self.now_ns) * u128::from(self.options.clock_hz)).div_ceil(1_000_000_000) as u64
    }

    #[expect(clippy::cast_possible_truncation, reason = "centuries")]
    fn nanoseconds(&self, cycles: u64) -> u64 {
        (u128::from(cycles) * 1_000_000_000).div_ceil(u128::from(self.options.clock_hz)) as u64
    }

    /// Switches the chips on: they accept SDATAC and RESET once the power-on time has passed.
    fn wake_chips(&mut self) {
        let awake_ns = self.now_ns + self.nanoseconds(u64::from(POWER_ON));
        self.chips.iter_mut().for_each(|chip| chip.power_on(awake_ns));
    }

    fn note(&mut self, event: Event) {
        self.events.push((self.now_ns, event));
    }

    /// Switches the supplies off: registers are lost, and DRDY stays high.
    pub(super) fn power_off(&mut self) {
        self.powered_ns = None;
        self.is_commanded = false;
        for chip in &mut self.chips {
            chip.power_on(u64::MAX);
        }
        self.burst = None;
        self.is_deaf = None;
        self.convert_at(None);
    }

    /// Switches the supplies of all chips on. The chips accept commands only after a reset, which
    /// must not start before the power-on time has passed.
    pub(super) fn power_on(&mut self) {
        if self.powered_ns.is_some() {
            return;
        }
        self.powered_ns = Some(self.now_ns);
        self.wake_chips();
        self.start_or_stop();
    }
}
