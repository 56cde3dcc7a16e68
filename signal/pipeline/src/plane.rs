//! Quantisation of electrodes to an int8 plane of the scalp grid.

use int8_nn::{requantise, saturate_i8};
use model::{CELLS, GRID_CELL, INPUT_MULTIPLIER};

use crate::front_end::Electrodes;

/// One time step of the scalp grid, row-major, int8. One level is
/// `model::INPUT_SCALE_UV` microvolts; a cell without an electrode is 0.
pub type Plane = [i8; CELLS];

/// Quantises filtered electrodes and places them on the scalp grid: `q = round(x * scale)`, rounded
/// half up, saturated to int8. Returns the plane and the number of clipped electrodes.
#[inline]
pub fn quantise(electrodes: &Electrodes) -> (Plane, u16) {
    let mut plane = [0; CELLS];
    let mut clipped = 0;
    for (&x, &cell) in electrodes.iter().zip(&GRID_CELL) {
        let level = requantise(x, INPUT_MULTIPLIER);
        let q = saturate_i8(level);
        clipped += u16::from(i32::from(q) != level);
        // Every index is on the grid; `get_mut` avoids a panic path that the compiler cannot exclude.
        if let Some(place) = plane.get_mut(usize::from(cell)) {
            *place = q;
        }
    }
    (plane, clipped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use model::{ELECTRODES, GUARD_BITS, INPUT_SCALE_UV, LSB_NV};

    #[test]
    fn a_plane_holds_microvolts_over_the_input_scale() {
        let uv = 100.0;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "100 uV are 143,165 in Q27.5"
        )]
        let x = (uv * 1_000.0 / LSB_NV * f32::from(1_u16 << GUARD_BITS)).round() as i32;
        let (plane, clipped) = quantise(&[x; ELECTRODES]);
        let q = f32::from(plane[usize::from(GRID_CELL[0])]);
        assert!((q - uv / INPUT_SCALE_UV).abs() <= 0.51, "{q}");
        assert_eq!(clipped, 0);
        assert_eq!(
            plane.iter().filter(|&&q| q == 0).count(),
            CELLS - ELECTRODES
        );
    }

    #[test]
    fn values_out_of_range_are_clipped_and_counted() {
        let mut electrodes = [0; ELECTRODES];
        electrodes[3] = i32::MAX;
        electrodes[7] = i32::MIN;
        let (plane, clipped) = quantise(&electrodes);
        assert_eq!(clipped, 2);
        assert_eq!(plane[usize::from(GRID_CELL[3])], 127);
        assert_eq!(plane[usize::from(GRID_CELL[7])], -128);
    }
}
