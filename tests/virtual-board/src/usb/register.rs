//! The register map of the core: offsets, names and bits, RM0433 rev 9 section 57.14 (RM0390
//! chapter 31 has the same map for the F446).

use std::fmt;

/// One register, or one FIFO, of the core in device mode.
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
    /// Size of the transmit FIFO with this number: `DIEPTXF0` to `DIEPTXF8`.
    Dieptxf(usize),
    Gnptxsts,
    Gccfg,
    Cid,
    /// Identification registers that ST's manuals leave out and drivers read, by offset.
    Undocumented(u32),
    Glpmcfg,
    Dcfg,
    Dctl,
    Dsts,
    Diepmsk,
    Doepmsk,
    Daint,
    Daintmsk,
    Dvbusdis,
    Dvbuspulse,
    Dthrctl,
    Diepempmsk,
    Diepctl(usize),
    Diepint(usize),
    Dieptsiz(usize),
    Dtxfsts(usize),
    Doepctl(usize),
    Doepint(usize),
    Doeptsiz(usize),
    Pcgcctl,
    /// The FIFO of the endpoint with this number; reads take from the receive FIFO, which all share.
    Fifo(usize),
}

/// Endpoints in each direction that the register map has room for.
pub(super) const MAX_ENDPOINTS: usize = 9;

/// Bytes between two endpoints' registers.
const ENDPOINT_STRIDE: u64 = 0x20;
/// Bytes of one FIFO's addresses.
const FIFO_STRIDE: u64 = 0x1000;

impl Register {
    /// The register at `offset` bytes from the core's base, for a core with `endpoints` endpoints.
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
            0x54 => Self::Glpmcfg,
            0x104..=0x120 => Self::Dieptxf(index(offset, 0x104, 4)? + 1),
            0x800 => Self::Dcfg,
            0x804 => Self::Dctl,
            0x808 => Self::Dsts,
            0x810 => Self::Diepmsk,
            0x814 => Self::Doepmsk,
            0x818 => Self::Daint,
            0x81C => Self::Daintmsk,
            0x828 => Self::Dvbusdis,
            0x82C => Self::Dvbuspulse,
            0x830 => Self::Dthrctl,
            0x834 => Self::Diepempmsk,
            0x900..=0xAFF => {
                let endpoint = usize::try_from((offset - 0x900) / ENDPOINT_STRIDE).ok()?;
                match (offset - 0x900) % ENDPOINT_STRIDE {
                    0x00 => Self::Diepctl(endpoint),
                    0x08 => Self::Diepint(endpoint),
                    0x10 => Self::Dieptsiz(endpoint),
                    0x18 => Self::Dtxfsts(endpoint),
                    _ => return None,
                }
            }
            0xB00..=0xCFF => {
                let endpoint = usize::try_from((offset - 0xB00) / ENDPOINT_STRIDE).ok()?;
                match (offset - 0xB00) % ENDPOINT_STRIDE {
                    0x00 => Self::Doepctl(endpoint),
                    0x08 => Self::Doepint(endpoint),
                    0x10 => Self::Doeptsiz(endpoint),
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

/// The place of `offset` in a row of registers from `first`, `stride` bytes apart.
fn index(offset: u64, first: u64, stride: u64) -> Option<usize> {
    let from_first = offset - first;
    from_first
        .is_multiple_of(stride)
        .then(|| usize::try_from(from_first / stride).ok())?
}

impl fmt::Display for Register {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Undocumented(offset) => write!(formatter, "OTG + {offset:#05x}"),
            Self::Dieptxf(n) => write!(formatter, "OTG_DIEPTXF{n}"),
            Self::Diepctl(n) => write!(formatter, "OTG_DIEPCTL{n}"),
            Self::Diepint(n) => write!(formatter, "OTG_DIEPINT{n}"),
            Self::Dieptsiz(n) => write!(formatter, "OTG_DIEPTSIZ{n}"),
            Self::Dtxfsts(n) => write!(formatter, "OTG_DTXFSTS{n}"),
            Self::Doepctl(n) => write!(formatter, "OTG_DOEPCTL{n}"),
            Self::Doepint(n) => write!(formatter, "OTG_DOEPINT{n}"),
            Self::Doeptsiz(n) => write!(formatter, "OTG_DOEPTSIZ{n}"),
            Self::Fifo(n) => write!(formatter, "FIFO {n}"),
            named => write!(formatter, "OTG_{}", format!("{named:?}").to_uppercase()),
        }
    }
}

/// Bits of `OTG_GINTSTS` and `OTG_GINTMSK`.
pub(super) mod gintsts {
    pub(in crate::usb) const OTGINT: u32 = 1 << 2;
    pub(in crate::usb) const SOF: u32 = 1 << 3;
    pub(in crate::usb) const RXFLVL: u32 = 1 << 4;
    pub(in crate::usb) const NPTXFE: u32 = 1 << 5;
    pub(in crate::usb) const GINAKEFF: u32 = 1 << 6;
    pub(in crate::usb) const GONAKEFF: u32 = 1 << 7;
    pub(in crate::usb) const ESUSP: u32 = 1 << 10;
    pub(in crate::usb) const USBSUSP: u32 = 1 << 11;
    pub(in crate::usb) const USBRST: u32 = 1 << 12;
    pub(in crate::usb) const ENUMDNE: u32 = 1 << 13;
    pub(in crate::usb) const EOPF: u32 = 1 << 15;
    pub(in crate::usb) const IEPINT: u32 = 1 << 18;
    pub(in crate::usb) const OEPINT: u32 = 1 << 19;
    pub(in crate::usb) const SRQINT: u32 = 1 << 30;
    pub(in crate::usb) const WKUPINT: u32 = 1 << 31;
    /// The bits that software clears by writing one.
    pub(in crate::usb) const CLEARABLE: u32 =
        SOF | ESUSP | USBSUSP | USBRST | ENUMDNE | EOPF | SRQINT | WKUPINT | 0x3030_4000;
}

/// Bits of `OTG_GRSTCTL`.
pub(super) mod grstctl {
    pub(in crate::usb) const CSRST: u32 = 1 << 0;
    pub(in crate::usb) const RXFFLSH: u32 = 1 << 4;
    pub(in crate::usb) const TXFFLSH: u32 = 1 << 5;
    pub(in crate::usb) const AHBIDL: u32 = 1 << 31;
    /// `TXFNUM` that means every transmit FIFO.
    pub(in crate::usb) const ALL_FIFOS: u32 = 0x10;

    /// The number of the FIFO to flush.
    pub(in crate::usb) const fn txfnum(value: u32) -> u32 {
        value >> 6 & 0x1F
    }
}

/// Bits of `OTG_DIEPCTLx` and `OTG_DOEPCTLx`.
pub(super) mod epctl {
    pub(in crate::usb) const MPSIZ: u32 = 0x7FF;
    pub(in crate::usb) const USBAEP: u32 = 1 << 15;
    pub(in crate::usb) const DPID: u32 = 1 << 16;
    pub(in crate::usb) const NAKSTS: u32 = 1 << 17;
    pub(in crate::usb) const EPTYP: u32 = 3 << 18;
    pub(in crate::usb) const SNPM: u32 = 1 << 20;
    pub(in crate::usb) const STALL: u32 = 1 << 21;
    pub(in crate::usb) const TXFNUM: u32 = 0xF << 22;
    pub(in crate::usb) const CNAK: u32 = 1 << 26;
    pub(in crate::usb) const SNAK: u32 = 1 << 27;
    pub(in crate::usb) const SD0PID: u32 = 1 << 28;
    pub(in crate::usb) const SD1PID: u32 = 1 << 29;
    pub(in crate::usb) const EPDIS: u32 = 1 << 30;
    pub(in crate::usb) const EPENA: u32 = 1 << 31;
}

/// Bits of `OTG_DIEPINTx` and `OTG_DOEPINTx`.
pub(super) mod epint {
    pub(in crate::usb) const XFRC: u32 = 1 << 0;
    pub(in crate::usb) const EPDISD: u32 = 1 << 1;
    /// Of an OUT endpoint: the setup stage is done.
    pub(in crate::usb) const STUP: u32 = 1 << 3;
    /// Of an IN endpoint: a token came while its FIFO was empty.
    pub(in crate::usb) const ITTXFE: u32 = 1 << 4;
    /// Of an OUT endpoint: an OUT token came while it was disabled.
    pub(in crate::usb) const OTEPDIS: u32 = 1 << 4;
    /// Of an IN endpoint: its NAK is effective.
    pub(in crate::usb) const INEPNE: u32 = 1 << 6;
    /// Of an IN endpoint, read only: its FIFO has room.
    pub(in crate::usb) const TXFE: u32 = 1 << 7;
}

/// Bits of `OTG_DCTL`.
pub(super) mod dctl {
    pub(in crate::usb) const RWUSIG: u32 = 1 << 0;
    pub(in crate::usb) const SDIS: u32 = 1 << 1;
    pub(in crate::usb) const GINSTS: u32 = 1 << 2;
    pub(in crate::usb) const GONSTS: u32 = 1 << 3;
    pub(in crate::usb) const SGINAK: u32 = 1 << 7;
    pub(in crate::usb) const CGINAK: u32 = 1 << 8;
    pub(in crate::usb) const SGONAK: u32 = 1 << 9;
    pub(in crate::usb) const CGONAK: u32 = 1 << 10;
    pub(in crate::usb) const POPRGDNE: u32 = 1 << 11;
}

/// Bits of the other registers.
pub(super) mod bit {
    /// `OTG_GAHBCFG`: interrupts reach the processor.
    pub(in crate::usb) const GINT: u32 = 1 << 0;
    /// `OTG_GAHBCFG`: `TXFE` means completely empty, not half empty.
    pub(in crate::usb) const TXFELVL: u32 = 1 << 7;
    /// `OTG_GUSBCFG`: device mode is forced.
    pub(in crate::usb) const FDMOD: u32 = 1 << 30;
    /// `OTG_GUSBCFG`: host mode is forced.
    pub(in crate::usb) const FHMOD: u32 = 1 << 29;
    /// `OTG_GOTGCTL`: B-session valid is overridden.
    pub(in crate::usb) const BVALOEN: u32 = 1 << 6;
    /// `OTG_GOTGCTL`: the value that overrides it.
    pub(in crate::usb) const BVALOVAL: u32 = 1 << 7;
    /// `OTG_GOTGCTL`: the ID pin says B-device.
    pub(in crate::usb) const CIDSTS: u32 = 1 << 16;
    /// `OTG_GOTGCTL`: the B-session is valid.
    pub(in crate::usb) const BSVLD: u32 = 1 << 19;
    /// `OTG_GOTGINT`: the session has ended.
    pub(in crate::usb) const SEDET: u32 = 1 << 2;
    /// `OTG_GCCFG`: the full-speed transceiver is on (the name says the opposite).
    pub(in crate::usb) const PWRDWN: u32 = 1 << 16;
    /// `OTG_GCCFG`: VBUS is sensed.
    pub(in crate::usb) const VBDEN: u32 = 1 << 21;
    /// `OTG_DSTS`: the bus is suspended.
    pub(in crate::usb) const SUSPSTS: u32 = 1 << 0;
    /// `OTG_DSTS`: `ENUMSPD` full speed.
    pub(in crate::usb) const FULL_SPEED: u32 = 3 << 1;
    /// `OTG_PCGCCTL`: the PHY's clock is stopped.
    pub(in crate::usb) const STPPCLK: u32 = 1 << 0;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_is_where_the_manual_puts_it() {
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
    fn reserved_offsets_and_endpoints_that_are_not_there_have_no_register() {
        for offset in [0x30, 0x124, 0x904, 0xB14, 0xD00, 0x8F0] {
            assert_eq!(Register::at(offset, MAX_ENDPOINTS), None, "{offset:#x}");
        }
        assert_eq!(Register::at(0x9C0, 6), None, "IN endpoint 6 of six");
        assert_eq!(Register::at(0x7000, 6), None, "its FIFO");
    }
}
