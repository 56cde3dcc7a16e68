//! Which kernel runs the second convolution.

use int8_nn::Winograd;

use crate::{
    integer_model::{CONV1, IntegerModel},
    pack::Unsigned,
};

/// Which kernel runs the second convolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConvKernel {
    /// [`int8_nn::Winograd`]: the fewest instructions.
    Winograd,
    /// [`int8_nn::Direct`]: any pool, any range.
    Direct,
}

impl ConvKernel {
    /// Winograd's, where its tiles of 2x4 outputs hold whole pools and its numbers fit.
    pub fn of(model: &IntegerModel) -> Self {
        type Kernel = Winograd<'static, { CONV1 / 2 }, 6>;
        let [_, rows, columns] = model.geometry.pool;
        let unsigned = Unsigned::of(model);
        let largest = usize::from(unsigned.largest());
        let whole_tiles = model.geometry.pooled[2].is_multiple_of(2);
        if [rows, columns] == [2, 2] && whole_tiles && largest <= Kernel::LARGEST_INPUT {
            Self::Winograd
        } else {
            Self::Direct
        }
    }
}
