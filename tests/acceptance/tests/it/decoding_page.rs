//! The Python program that docs/decoding.md prints decodes codes to the same microvolts as the
//! crate `reconstruction`.

use std::fs;

use acceptance::{numpy_reference, workspace};
use any_model::{Size, any_artifact_with, every_variant};
use artifact::reconstruction::WindowDecoder;
use artifact::{Artifact, Mode, NetworkShape, Padding};

/// Main program that the test appends to the program in docs/decoding.md. Its argument is the
/// model's folder. It decodes the codes in that folder's file `z.f32`, and writes the decoded
/// windows to `windows.f64` in the same folder.
const MAIN: &str = r#"
folder = Path(sys.argv[1])
decoder = Decoder(folder)
codes = np.fromfile(folder / "z.f32", "<f4").reshape(-1, decoder.model["code"]["numbers"])
np.array([decoder.window(z) for z in codes.astype(float)]).tofile(folder / "windows.f64")
"#;

/// Of all variants of the network, the test decodes every fifth, to save time. These still include
/// each padding and each mode.
const EVERY: usize = 5;

/// Number of codes that the test decodes with each network.
const CODES: usize = 3;

/// Largest permitted difference between the two decoders, as a ratio to the largest decoded value;
/// the Rust decoder computes in f32.
const TOLERANCE: f64 = 1e-5;

/// Networks with other sizes than the paper's: one row of electrodes, and the largest grid.
const SIZES: [(Size, Padding, [usize; 3]); 2] = [
    (
        Size { grid: [1, 8], electrodes: 8, steps: 32, hop: 8, numbers: 16 },
        Padding::Space,
        [2, 1, 2],
    ),
    (
        Size { grid: [12, 12], electrodes: 64, steps: 16, hop: 4, numbers: 256 },
        Padding::None,
        [2, 2, 2],
    ),
];

#[test]
fn the_program_of_the_page_decodes_as_the_bridge_does() {
    if !numpy_reference::available("the program of docs/decoding.md") {
        return;
    }
    let paper = every_variant()
        .into_iter()
        .filter(|(mode, ..)| *mode != Mode::Paper)
        .step_by(EVERY)
        .map(|(mode, padding, pool)| (mode, padding, pool, Size::paper(8)));
    let others = SIZES.map(|(size, padding, pool)| (Mode::Shortcut, padding, pool, size));
    for (seed, (mode, padding, pool, size)) in (1..).zip(paper.chain(others)) {
        let artifact = any_artifact_with(seed, |description| {
            description.mode = mode;
            description.network = NetworkShape { padding, pool };
            size.apply(description);
        });
        let artifact = artifact.expect("an artifact");
        let what = format!("{mode:?}, {padding:?}, {pool:?}, {size:?}");
        let worst = compare(&artifact);
        println!("{what}: {worst:.1e}");
        assert!(worst < TOLERANCE, "{what}: {worst:e}");
    }
}

/// Decodes [`CODES`] codes with both decoders. Returns the ratio of their largest difference to the
/// largest value.
fn compare(artifact: &Artifact) -> f64 {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    artifact.write(folder).expect("a folder to write to");
    let numbers = artifact.description.code.numbers;
    let count = u16::try_from(CODES * numbers).expect("few numbers");
    let z: Vec<f32> = (0..count).map(|k| 3.0 * (f32::from(k) * 0.7).sin()).collect();
    let bytes: Vec<u8> = z.iter().flat_map(|z| z.to_le_bytes()).collect();
    fs::write(folder.join("z.f32"), bytes).expect("the folder is writable");
    let script = folder.join("decoding.py");
    fs::write(&script, format!("{}{MAIN}", program())).expect("the folder is writable");
    numpy_reference::run(script, folder).unwrap_or_else(|error| panic!("{error}"));
    let theirs = fs::read(folder.join("windows.f64")).expect("numpy's windows");
    let theirs = theirs.as_chunks().0.iter().copied().map(f64::from_le_bytes);
    let theirs: Vec<f64> = theirs.collect();

    let decoder = WindowDecoder::new(artifact).expect("a decoder");
    let ours: Vec<f32> = z.chunks_exact(numbers).flat_map(|z| decoder.decode(z)).collect();
    assert_eq!(ours.len(), theirs.len());
    let largest = theirs.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(largest > 1.0, "{largest} uV");
    let pairs = ours.iter().zip(&theirs);
    let differences = pairs.map(|(ours, theirs)| (f64::from(*ours) - theirs).abs());
    differences.fold(0.0, f64::max) / largest
}

/// Returns the Python program in docs/decoding.md.
fn program() -> String {
    let page = fs::read_to_string(workspace::root().join("docs/decoding.md")).expect("the page");
    let (_, text) = page.split_once("```python\n").expect("a program");
    let (program, _) = text.split_once("```").expect("the program ends");
    program.to_owned()
}
