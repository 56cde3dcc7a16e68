//! The files of the page, and the positions of electrodes on its map.

use picture::scalp_map::on_map;
use recordings::Position;

/// A file of the page.
pub(crate) struct PageFile {
    pub(crate) content_type: &'static str,
    pub(crate) text: &'static str,
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Path, content type and text of every file. A request names one of these paths or is refused, so
/// no path leads to the file system.
const FILES: [(&str, &str, &str); 22] = [
    ("/", "text/html; charset=utf-8", include_str!("../page/index.html")),
    ("/style.css", "text/css; charset=utf-8", include_str!("../page/style.css")),
    ("/icon.svg", "image/svg+xml", include_str!("../page/icon.svg")),
    ("/axis.js", SCRIPT, include_str!("../page/axis.js")),
    ("/session.js", SCRIPT, include_str!("../page/session.js")),
    ("/code.js", SCRIPT, include_str!("../page/code.js")),
    ("/columns.js", SCRIPT, include_str!("../page/columns.js")),
    ("/element.js", SCRIPT, include_str!("../page/element.js")),
    ("/events.js", SCRIPT, include_str!("../page/events.js")),
    ("/feed.js", SCRIPT, include_str!("../page/feed.js")),
    ("/head.js", SCRIPT, include_str!("../page/head.js")),
    ("/history.js", SCRIPT, include_str!("../page/history.js")),
    ("/link.js", SCRIPT, include_str!("../page/link.js")),
    ("/main.js", SCRIPT, include_str!("../page/main.js")),
    ("/palette.js", SCRIPT, include_str!("../page/palette.js")),
    ("/plot.js", SCRIPT, include_str!("../page/plot.js")),
    ("/reference.js", SCRIPT, include_str!("../page/reference.js")),
    ("/spectrum.js", SCRIPT, include_str!("../page/spectrum.js")),
    ("/spectrum_panel.js", SCRIPT, include_str!("../page/spectrum_panel.js")),
    ("/store.js", SCRIPT, include_str!("../page/store.js")),
    ("/traces.js", SCRIPT, include_str!("../page/traces.js")),
    ("/welch.js", SCRIPT, include_str!("../page/welch.js")),
];

pub(crate) fn file(path: &str) -> Option<PageFile> {
    let (_, content_type, text) = FILES.into_iter().find(|(known, ..)| *known == path)?;
    Some(PageFile { content_type, text })
}

/// Returns the positions of electrodes on a map of the scalp, as a JSON list of `[x, y]`: x towards
/// the right ear, y towards the nose, the outermost circle of the 10-20 system at 0.9; `null` for a
/// label that denotes no electrode. `labels` are separated by commas.
pub(crate) fn places(labels: &str) -> String {
    let places = labels.split(',').map(|label| {
        let Position { x, y, z } = Position::from_label(label)?;
        Some(on_map([x, y, z]))
    });
    let places = places.map(|place| place.map(|place| place.to_vec()));
    places.collect::<serde_json::Value>().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn electrodes_have_places_and_other_labels_have_none() {
        assert_eq!(places("Cz,exg1,"), "[[0.0,0.0],null,null]");
        let all: Vec<[f64; 2]> = serde_json::from_str(&places("Oz,T7")).expect("two places");
        let expected = [[0.0, -0.9], [-0.9, 0.0]];
        for (found, expected) in all.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-9, "{all:?}");
        }
    }
}
