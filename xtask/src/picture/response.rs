//! What the filters let pass: measured on the fixed-point chain, and as designed.

use std::f64::consts::PI;
use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, REFERENCE, RESULT, SOURCE};

/// The filters as specified, for the closed formulas that the measurement is drawn against.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Design {
    /// Rate of the samples, Hz.
    pub(crate) rate_hz: f64,
    /// Mains, Hz.
    pub(crate) mains_hz: f64,
    /// Quality factor of the notch.
    pub(crate) notch_q: f64,
    /// Corners of the band-pass at -3 dB, Hz.
    pub(crate) band_hz: [f64; 2],
    /// Order of the band-pass.
    pub(crate) order: i32,
}

impl Design {
    /// Magnitude at a frequency, dB: notch and Butterworth band-pass through the bilinear transform.
    ///
    /// Band-pass: `1 / (1 + ((W² - Wl Wh) / (W (Wh - Wl)))^(2 order))` with `W = tan(pi f / rate)`.
    /// Notch: `(c - c0)² / ((c - c0)² + tan²(bw/2) sin²(w))`, `c = cos w`, `bw = w0 / q`.
    pub(crate) fn magnitude_db(&self, hz: f64) -> f64 {
        let warped = |hz: f64| (PI * hz / self.rate_hz).tan();
        let [low, high] = self.band_hz.map(warped);
        let w = warped(hz);
        let ratio = (w * w - low * high) / (w * (high - low));
        let band_pass = 1.0 / (1.0 + ratio.powi(2 * self.order));
        let angle = |hz: f64| 2.0 * PI * hz / self.rate_hz;
        let distance = (angle(hz).cos() - angle(self.mains_hz).cos()).powi(2);
        let half_width = (angle(self.mains_hz) / self.notch_q / 2.0).tan();
        let notch = distance / (distance + (half_width * angle(hz).sin()).powi(2));
        10.0 * (band_pass * notch).log10()
    }
}

/// Magnitude over frequency.
#[derive(Debug, Clone)]
pub(crate) struct Response {
    /// The specification.
    pub(crate) design: Design,
    /// Frequency in Hz and measured magnitude in dB, rising.
    pub(crate) measured: Vec<(f64, f64)>,
    /// One line under the title.
    pub(crate) subtitle: String,
}

const SIZE: (u32, u32) = (1200, 700);
const LOWEST_DB: f64 = -100.0;
const HIGHEST_DB: f64 = 8.0;
const TICKS_HZ: [f64; 11] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];

impl Response {
    /// Writes the picture.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let title = "The filters, measured on the fixed-point chain";
        canvas::page(path, SIZE, [title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    /// Largest deviation of measurement and design where the design passes more than -40 dB, dB.
    pub(crate) fn worst_error_db(&self) -> f64 {
        let passed = self
            .measured
            .iter()
            .map(|(hz, db)| (self.design.magnitude_db(*hz), db));
        passed
            .filter(|(design, _)| *design > -40.0)
            .map(|(design, db)| (design - db).abs())
            .fold(0.0, f64::max)
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let (first, last) = (0.1, self.design.rate_hz / 2.0);
        let mut chart = ChartBuilder::on(area)
            .margin_top(40)
            .margin_left(20)
            .margin_right(36)
            .margin_bottom(16)
            .x_label_area_size(52)
            .y_label_area_size(66)
            .build_cartesian_2d((first..last).log_scale(), LOWEST_DB..HIGHEST_DB)?;
        let [low, high] = self.design.band_hz;
        let band = Rectangle::new(
            [(low, LOWEST_DB), (high, HIGHEST_DB)],
            REFERENCE.mix(0.07).filled(),
        );
        chart.draw_series([band])?;
        chart
            .configure_mesh()
            .light_line_style(WHITE.mix(0.0))
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .disable_x_mesh()
            .x_labels(0)
            // Our own ticks, below: plotters labels powers of ten only.
            .x_label_formatter(&|_| String::new())
            .set_tick_mark_size(LabelAreaPosition::Bottom, 0)
            .y_labels(12)
            .y_label_formatter(&|db| format!("{db:.0}").replace('-', "−"))
            .x_desc("frequency (Hz)")
            .y_desc("magnitude (dB)")
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;

        for hz in TICKS_HZ {
            let line = vec![(hz, LOWEST_DB), (hz, HIGHEST_DB)];
            chart.draw_series([PathElement::new(line, GRID)])?;
            let (x, y) = chart.backend_coord(&(hz, LOWEST_DB));
            let at = (x, y - area.get_base_pixel().1 + 16);
            area.draw(&Text::new(
                hz.to_string(),
                at,
                canvas::anchored(15, INK, HPos::Center),
            ))?;
        }

        let shown = |(hz, db): (f64, f64)| (hz, db.max(LOWEST_DB));
        let measured: Vec<(f64, f64)> = self.measured.iter().copied().map(shown).collect();
        chart.draw_series([PathElement::new(measured, SOURCE.stroke_width(3))])?;
        let design = (0..120).map(|step| first * (last / first).powf(f64::from(step) / 119.5));
        let design = design.map(|hz| shown((hz, self.design.magnitude_db(hz))));
        let inside = design.filter(|(_, db)| *db > LOWEST_DB);
        chart.draw_series(inside.map(|point| Circle::new(point, 4, RESULT.stroke_width(2))))?;
        for (hz, side, gap) in [
            (low, HPos::Left, 1.02),
            (self.design.mains_hz, HPos::Right, 0.98),
            (high, HPos::Left, 1.02),
        ] {
            let line = vec![(hz, LOWEST_DB), (hz, LOWEST_DB + 8.0)];
            chart.draw_series([PathElement::new(line, REFERENCE.stroke_width(2))])?;
            let label = canvas::anchored(15, REFERENCE, side);
            let at = (hz * gap, LOWEST_DB + 6.0);
            chart.draw_series([Text::new(format!("{hz} Hz"), at, label)])?;
        }
        canvas::legend(
            area,
            (90, 8),
            SOURCE,
            "measured: impulses through the integer filters",
        )?;
        canvas::legend(
            area,
            (520, 8),
            RESULT,
            "design: closed formulas of notch and Butterworth",
        )?;
        canvas::legend(area, (960, 8), REFERENCE, "pass band of the paper")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Design = Design {
        rate_hz: 512.0,
        mains_hz: 50.0,
        notch_q: 30.0,
        band_hz: [0.5, 60.0],
        order: 5,
    };

    #[test]
    fn the_design_is_minus_3_db_at_its_corners_and_zero_inside() {
        assert!((PAPER.magnitude_db(0.5) + 3.01).abs() < 0.01);
        assert!(
            (PAPER.magnitude_db(60.0) + 3.01).abs() < 0.15,
            "the notch costs a little at 60 Hz"
        );
        assert!(PAPER.magnitude_db(10.0).abs() < 0.01);
        assert!(PAPER.magnitude_db(50.0) < -250.0);
    }

    /// `scipy.signal.freqz` of `butter(5, [0.5, 60], 'bandpass', fs=512)` times `iirnotch(50, 30, 512)`.
    #[test]
    fn the_design_is_scipys() {
        let scipy = [
            (0.3, -22.432_107_5),
            (30.0, -0.006_695_2),
            (49.0, -2.703_321_9),
            (100.0, -26.399_503_5),
        ];
        for (hz, db) in scipy {
            assert!((PAPER.magnitude_db(hz) - db).abs() < 1e-6, "{hz} Hz: {db}");
        }
    }
}
