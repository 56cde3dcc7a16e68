//! Rate of the packed code that a device is to have.

/// Rate that the device is to have, and whether it has answered the command for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WantedRate {
    rate: u8,
    is_answered: bool,
}

impl WantedRate {
    pub(crate) const fn new(rate: u8) -> WantedRate {
        WantedRate {
            rate,
            is_answered: false,
        }
    }

    /// Returns the rate if the device must be told.
    pub(crate) fn due(self) -> Option<u8> {
        (!self.is_answered).then_some(self.rate)
    }

    /// Records that the device has answered, whatever it says.
    pub(crate) fn answered(&mut self) {
        self.is_answered = true;
    }

    /// The device may have another rate by now, and must be told again.
    pub(crate) fn tell_again(&mut self) {
        self.is_answered = false;
    }
}
