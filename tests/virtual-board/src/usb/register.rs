//! Registers of the USB core: offsets, names and bits (RM0433 rev 9, section 57.14; RM0390 chapter
//! 31 gives the same for the STM32F446).

use std::fmt;

/// A register or FIFO of the USB core in device mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Register {
    Gotgctl,
    Gotgint,
    Gahbcfg,
    Gusbcfg,
    Grstctl,
    Gintsts,
    Gintmsk,
    Grxstsr,
    Grxstsp,
    Grxfsiz,
    /// Start and size of the transmit FIFO with this number: `DIEPTXF0` to `DIEPTXF8`.
    Dieptxf(usize),
    Gnptxsts,
    Gccfg,
    Cid,
    /// Identification register at this offset; drivers read it, but ST's manuals omit it.
    Undocumented(u32),
    Dcfg,
    Dctl,
    Dsts,
    Diepmsk,
    Doepmsk,
    Daint,
    Daintmsk,
    Diepempmsk,
    Diepctl(usize),
    Diepint(usize),
    Dieptsiz(usize),
    Dtxfsts(usize),
    Doepctl(usize),
    Doepint(usize),
    Doeptsiz(usize),
    Pcgcctl,
    /// FIFO address of the endpoint with this number. Reads at any of these addresses take data
    /// from the receive FIFO, which all endpoints share.
    Fifo(usize),
}

/// Largest number of endpoints per direction for which there are registers.
pub(super) const MAX_ENDPOINTS: usize = 9;

/// Distance in bytes between the registers of two consecutive endpoints.
const ENDPOINT_STRIDE: u64 = 0x20;
/// Size of the address range of one FIFO, in bytes.
const FIFO_STRIDE: u64 = 0x1000;

impl Register {
    /// Returns the register at `offset` bytes from the core's base address; `None` if a core with
    /// `endpoints` endpoints has none there.
    pub(super) fn at(offset: u64, endpoints: usize) -> Option<Self> {
        let register = match offset {
            0x00 => Self::Gotgctl,
            0x04 => Self::Gotgint,
            0x08 => Self::Gahbcfg,
            0x0C => Self::Gusbcfg,
            0x10 => Self::Grstctl,
            0x14 => Self::Gintsts,
            0x18 => Self::Gintmsk,
            0x1C => Self::Grxstsr,
            0x20 => Self::Grxstsp,
            0x24 => Self::Grxfsiz,
            0x28 => Self::Dieptxf(0),
            0x2C => Self::Gnptxsts,
            0x38 => Self::Gccfg,
            0x3C => Self::Cid,
            0x40 | 0x44 | 0x48 | 0x4C | 0x50 => Self::Undocumented(u32::try_from(offset).ok()?),
            0x104..=0x120 if offset.is_multiple_of(4) => {
                Self::Dieptxf(usize::try_from((offset - 0x100) / 4).ok()?)
            }
            0x800 => Self::Dcfg,
            0x804 => Self::Dctl,
            0x808 => Self::Dsts,
            0x810 => Self::Diepmsk,
            0x814 => Self::Doepmsk,
            0x818 => Self::Daint,
            0x81C => Self::Daintmsk,
            0x834 => Self::Diepempmsk,
            0x900..=0xCFF => {
                let is_in = offset < 0xB00;
                let place = offset - if is_in { 0x900 } else { 0xB00 };
                let endpoint = usize::try_from(place / ENDPOINT_STRIDE).ok()?;
                match (is_in, place % ENDPOINT_STRIDE) {
                    (true, 0x00) => Self::Diepctl(endpoint),
                    (true, 0x08) => Self::Diepint(endpoint),
                    (true, 0x10) => Self::Dieptsiz(endpoint),
                    (true, 0x18) => Self::Dtxfsts(endpoint),
                    (false, 0x00) => Self::Doepctl(endpoint),
                    (false, 0x08) => Self::Doepint(endpoint),
                    (false, 0x10) => Self::Doeptsiz(endpoint),
                    _ => return None,
                }
            }
            0xE00 => Self::Pcgcctl,
            0x1000.. => Self::Fifo(usize::try_from(offset / FIFO_STRIDE - 1).ok()?),
            _ => return None,
        };
        let exists = match register {
            Self::Dieptxf(n)
            | Self::Diepctl(n)
            | Self::Diepint(n)
            | Self::Dieptsiz(n)
            | Self::Dtxfsts(n)
            | Self::Doepctl(n)
            | Self::Doepint(n)
            | Self::Doeptsiz(n)
            | Self::Fifo(n) => n < endpoints,
            _ => true,
        };
        exists.then_some(register)
    }
}

impl fmt::Display for Register {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Undocumented(offset) => write!(formatter, "OTG + {offset:#05x}"),
            Self::Fifo(n) => write!(formatter, "FIFO {n}"),
            // Turn Rust's `Dieptxf(3)` into `OTG_DIEPTXF3`, as in the manual.
            named => {
                let name = format!("{named:?}").to_uppercase();
                write!(formatter, "OTG_{}", name.replace(['(', ')'], ""))
            }
        }
    }
}

/// Bits of `OTG_GINTSTS` and `OTG_GINTMSK`.
pub(super) mod gintsts {
    pub(crate) const OTGINT: u32 = 1 << 2;
    pub(crate) const SOF: u32 = 1 << 3;
    pub(crate) const RXFLVL: u32 = 1 << 4;
    pub(crate) const NPTXFE: u32 = 1 << 5;
    pub(crate) const GINAKEFF: u32 = 1 << 6;
    pub(crate) const GONAKEFF: u32 = 1 << 7;
    pub(crate) const ESUSP: u32 = 1 << 10;
    pub(crate) const USBSUSP: u32 = 1 << 11;
    pub(crate) const USBRST: u32 = 1 << 12;
    pub(crate) const ENUMDNE: u32 = 1 << 13;
    pub(crate) const EOPF: u32 = 1 << 15;
    pub(crate) const IEPINT: u32 = 1 << 18;
    pub(crate) const OEPINT: u32 = 1 << 19;
    pub(crate) const SRQINT: u32 = 1 << 30;
    pub(crate) const WKUPINT: u32 = 1 << 31;
    /// Bits that software clears by writing 1 to them.
    pub(crate) const CLEARABLE: u32 =
        SOF | ESUSP | USBSUSP | USBRST | ENUMDNE | EOPF | SRQINT | WKUPINT | 0x3030_4000;
}

/// Bits of `OTG_GRSTCTL`.
pub(super) mod grstctl {
    pub(crate) const CSRST: u32 = 1 << 0;
    pub(crate) const RXFFLSH: u32 = 1 << 4;
    pub(crate) const TXFFLSH: u32 = 1 << 5;
    pub(crate) const AHBIDL: u32 = 1 << 31;
    /// Value of the field `TXFNUM` that selects all transmit FIFOs.
    pub(crate) const ALL_FIFOS: u32 = 0x10;

    /// Returns the field `TXFNUM`, which is the number of the transmit FIFO to flush.
    pub(crate) const fn txfnum(value: u32) -> u32 {
        value >> 6 & 0x1F
    }
}

/// Bits of `OTG_DIEPCTLx` and `OTG_DOEPCTLx`.
pub(super) mod epctl {
    pub(crate) const MPSIZ: u32 = 0x7FF;
    pub(crate) const USBAEP: u32 = 1 << 15;
    pub(crate) const DPID: u32 = 1 << 16;
    pub(crate) const NAKSTS: u32 = 1 << 17;
    pub(crate) const EPTYP: u32 = 3 << 18;
    pub(crate) const SNPM: u32 = 1 << 20;
    pub(crate) const STALL: u32 = 1 << 21;
    pub(crate) const TXFNUM: u32 = 0xF << 22;
    pub(crate) const CNAK: u32 = 1 << 26;
    pub(crate) const SNAK: u32 = 1 << 27;
    pub(crate) const SD0PID: u32 = 1 << 28;
    pub(crate) const SD1PID: u32 = 1 << 29;
    pub(crate) const EPDIS: u32 = 1 << 30;
    pub(crate) const EPENA: u32 = 1 << 31;
}

/// Bits of `OTG_DIEPINTx` and `OTG_DOEPINTx`.
pub(super) mod epint {
    pub(crate) const XFRC: u32 = 1 << 0;
    pub(crate) const EPDISD: u32 = 1 << 1;
    /// OUT endpoint 0: the setup stage has ended.
    pub(crate) const STUP: u32 = 1 << 3;
    /// IN endpoint: a token was received while the transmit FIFO was empty.
    pub(crate) const ITTXFE: u32 = 1 << 4;
    /// OUT endpoint: an OUT token was received while the endpoint was disabled.
    pub(crate) const OTEPDIS: u32 = 1 << 4;
    /// IN endpoint: the NAK that software has set is effective.
    pub(crate) const INEPNE: u32 = 1 << 6;
    /// IN endpoint, read only: the transmit FIFO has room.
    pub(crate) const TXFE: u32 = 1 << 7;
}

/// Bits of `OTG_DCTL`.
pub(super) mod dctl {
    pub(crate) const RWUSIG: u32 = 1 << 0;
    pub(crate) const SDIS: u32 = 1 << 1;
    pub(crate) const GINSTS: u32 = 1 << 2;
    pub(crate) const GONSTS: u32 = 1 << 3;
    pub(crate) const SGINAK: u32 = 1 << 7;
    pub(crate) const CGINAK: u32 = 1 << 8;
    pub(crate) const SGONAK: u32 = 1 << 9;
    pub(crate) const CGONAK: u32 = 1 << 10;
    pub(crate) const POPRGDNE: u32 = 1 << 11;
}

/// Bits of all registers that have no module of their own here.
pub(super) mod bit {
    /// `OTG_GAHBCFG`: enables the core's global interrupt.
    pub(crate) const GINT: u32 = 1 << 0;
    /// `OTG_GAHBCFG`: makes the flag `TXFE` mean that a FIFO is empty instead of half empty.
    pub(crate) const TXFELVL: u32 = 1 << 7;
    /// `OTG_GUSBCFG`: forces device mode.
    pub(crate) const FDMOD: u32 = 1 << 30;
    /// `OTG_GUSBCFG`: forces host mode.
    pub(crate) const FHMOD: u32 = 1 << 29;
    /// `OTG_GOTGCTL`: lets `BVALOVAL` decide whether the B-session is valid.
    pub(crate) const BVALOEN: u32 = 1 << 6;
    /// `OTG_GOTGCTL`: whether the B-session is valid if `BVALOEN` is set.
    pub(crate) const BVALOVAL: u32 = 1 << 7;
    /// `OTG_GOTGCTL`: the ID pin indicates a B-device.
    pub(crate) const CIDSTS: u32 = 1 << 16;
    /// `OTG_GOTGCTL`: the B-session is valid, so the device may connect.
    pub(crate) const BSVLD: u32 = 1 << 19;
    /// `OTG_GOTGINT`: the B-session has ended.
    pub(crate) const SEDET: u32 = 1 << 2;
    /// `OTG_GCCFG`: switches the full-speed transceiver on, contrary to the bit's name.
    pub(crate) const PWRDWN: u32 = 1 << 16;
    /// `OTG_GCCFG`: lets the core sense VBUS.
    pub(crate) const VBDEN: u32 = 1 << 21;
    /// `OTG_DSTS`: the bus is suspended.
    pub(crate) const SUSPSTS: u32 = 1 << 0;
    /// `OTG_DSTS`: value of the field `ENUMSPD` that stands for full speed.
    pub(crate) const FULL_SPEED: u32 = 3 << 1;
    /// `OTG_PCGCCTL`: stops the PHY's clock.
    pub(crate) const STPPCLK: u32 = 1 << 0;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_has_the_offset_of_the_manual() {
        for (offset, name) in [
            (0x010, "OTG_GRSTCTL"),
            (0x028, "OTG_DIEPTXF0"),
            (0x108, "OTG_DIEPTXF2"),
            (0x940, "OTG_DIEPCTL2"),
            (0xBE8, "OTG_DOEPINT7"),
            (0xC10, "OTG_DOEPTSIZ8"),
            (0xE00, "OTG_PCGCCTL"),
            (0x2000, "FIFO 1"),
            (0x2FFC, "FIFO 1"),
        ] {
            let register = Register::at(offset, MAX_ENDPOINTS).map(|register| register.to_string());
            assert_eq!(register.as_deref(), Some(name), "{offset:#x}");
        }
    }

    #[test]
    fn reserved_offsets_and_missing_endpoints_have_no_register() {
        for offset in [0x30, 0x124, 0x904, 0xB14, 0xD00, 0x8F0] {
            assert_eq!(Register::at(offset, MAX_ENDPOINTS), None, "{offset:#x}");
        }
        assert_eq!(Register::at(0x9C0, 6), None, "IN endpoint 6 of six");
        assert_eq!(Register::at(0x7000, 6), None, "its FIFO");
    }
}
