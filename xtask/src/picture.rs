//! Pictures of the demo and the benchmark: SVG, drawn without any font or library of the system.

pub(crate) mod canvas;
pub(crate) mod curves;
pub(crate) mod heat_map;
pub(crate) mod intervals;
pub(crate) mod traces;

#[cfg(test)]
mod tests {
    use super::heat_map::HeatMap;
    use super::intervals::Intervals;
    use super::traces::{Trace, Traces};

    /// Made-up signals with the shape of a run: the test is about drawing.
    #[test]
    fn every_picture_is_drawn_with_its_title_axes_and_data() {
        let folder = tempfile::tempdir().expect("a folder");
        let wave = |electrode: f32, step: f32| {
            20.0 * (0.5 * step + electrode).sin() + 5.0 * (0.11 * step).cos()
        };
        let trace = |electrode: u8| Trace {
            label: format!("E{electrode}"),
            source_uv: (0..512_u16)
                .map(|step| wave(electrode.into(), step.into()))
                .collect(),
            result_uv: (0..512_u16)
                .map(|step| 0.9 * wave(electrode.into(), step.into()))
                .collect(),
        };
        let subtitle = || "made-up data".to_owned();
        let traces = Traces {
            rows: (0..6).map(trace).collect(),
            rate_hz: 128.0,
            begin_s: 3.0,
            subtitle: subtitle(),
        };
        traces
            .draw(&folder.path().join("traces.svg"))
            .expect("drawn");
        let value = |time: u16, component: u16| {
            wave(component.into(), f32::from(time) * 0.6) * f32::from(component)
        };
        let code = |time: u16| {
            (time != 77).then(|| (0..128).map(|component| value(time, component)).collect())
        };
        let map = HeatMap {
            codes: (0..240).map(code).collect(),
            begin_s: 0.1,
            settling: 40,
            interval_s: 0.0625,
            subtitle: subtitle(),
        };
        map.draw(&folder.path().join("codes.svg")).expect("drawn");
        let arrival_ms = (0..240_u16)
            .map(|index| 62.5 + 0.4 * (f64::from(index) * 1.7).sin())
            .collect();
        let intervals = Intervals {
            arrival_ms,
            device_ms: vec![62.5; 240],
            subtitle: subtitle(),
        };
        intervals
            .draw(&folder.path().join("intervals.svg"))
            .expect("drawn");

        for (name, word, shapes) in [
            ("traces.svg", "time since the device", 12),
            ("codes.svg", "component of the code", 128),
            ("intervals.svg", "interval (ms)", 10),
        ] {
            let text = std::fs::read_to_string(folder.path().join(name)).expect("written");
            assert!(
                text.contains(word) && text.contains("made-up data"),
                "{name}"
            );
            let drawn = text.matches("<polyline").count()
                + text.matches("<rect").count()
                + text.matches("<circle").count();
            assert!(drawn >= shapes, "{name}: {drawn} shapes");
        }
    }
}
