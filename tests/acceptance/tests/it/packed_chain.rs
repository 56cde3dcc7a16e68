//! The electrode signals that a user gets from packed blocks equal those that the library decodes:
//! live from a real roscore, printed, recorded, replayed, converted, and after losses.

use std::path::Path;
use std::time::Duration;

use acceptance::chain::{Chain, messages_of};
use acceptance::files::Table;
use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::printing::{self, board, messages, values};
use acceptance::process::{Process, SLACK};
use acceptance::ros;
use artifact::reconstruction::{PackedBlock, PackedDecoder};
use emulator::skip::skipped;
use link::Flags;
use model::{ADC_RATE_HZ, ELECTRODES, HOP, STEP_RATE_HZ, SUBSTITUTION};
use pipeline::{Acquisition, ExclusionPolicy, Mains, PackedEncoder, Rate, Substitution};

use crate::inputs::{artifact, synthetic};

/// Duration of the EEG that the board encodes, in seconds.
const SECONDS: usize = 8;
/// Rate of the packed code; not the default, so that the bridge must set it.
const RATE: u8 = 3;
/// Number of blocks that the board sends in [`SECONDS`].
const BLOCKS: usize = SECONDS * STEP_RATE_HZ as usize / HOP;

const SUBSTITUTED: u64 = Flags::SUBSTITUTED.bits() as u64;

/// One frame of `/neurodata_reconstructed`: the decoded values, and the flags of the block.
type Frame = (Vec<f32>, u64);

/// Returns the packed blocks that the pipeline computes from the board's synthetic EEG. If the
/// model has a table of substitutions, the electrodes `excluded` (bit n is electrode n) are filled
/// from the others.
fn blocks(excluded: u64) -> Vec<Vec<u8>> {
    let mut acquisition = Acquisition::new(Mains::Hz50);
    let mut encoder = Box::new(PackedEncoder::new());
    encoder.set_rate(Rate::new(RATE).expect("a rate"));
    let mut substitution = Box::new(Substitution::NEW);
    let policy = ExclusionPolicy { always: excluded, ..ExclusionPolicy::AUTOMATIC };
    let samples = synthetic(7).take(SECONDS * usize::from(ADC_RATE_HZ));
    let steps = samples.filter_map(|sample| {
        substitution.observe_sample(&sample);
        let mut step = acquisition.process_sample(&sample)?;
        if let Some(table) = &SUBSTITUTION {
            substitution.fill_step(&mut step, policy, table);
        }
        Some(step)
    });
    let blocks: Vec<Vec<u8>> =
        steps.filter_map(|step| Some(encoder.encode_step(&step)?.bytes().to_vec())).collect();
    assert_eq!(blocks.len(), BLOCKS);
    blocks
}

/// Decodes blocks with the library; `None` stands for a lost block.
fn decode(blocks: &[Option<&Vec<u8>>]) -> Vec<PackedBlock> {
    let artifact = artifact();
    let mut decoder = PackedDecoder::new(artifact.packed.as_ref().expect("a packed model"));
    let rate = Rate::new(RATE).expect("a rate");
    let decoded = blocks.iter().map(|block| match block {
        Some(bytes) => decoder.decode(bytes, rate).expect("a block"),
        None => PackedBlock { microvolts: decoder.skip(), smoothed: None, is_sound: false },
    });
    decoded.collect()
}

/// Returns the frames that the bridge publishes without its option for low latency: the signals of
/// each block as corrected by the next block, and the last block uncorrected.
fn expected(decoded: &[PackedBlock]) -> Vec<Vec<f32>> {
    let pairs = decoded.windows(2);
    let smoothed = pairs.map(|pair| pair[1].smoothed.as_ref().unwrap_or(&pair[0].microvolts));
    let last = decoded.last().map(|block| &block.microvolts);
    smoothed.chain(last).cloned().collect()
}

/// Starts a bridge that prints what it decodes from the packed blocks of the board at `port`.
fn print_blocks(folder: &Path, port: &str, options: &[&str]) -> Process {
    let rate = format!("--packed-rate={RATE}");
    let options = [&["--streams=packed", &rate], options].concat();
    printing::print(folder, port, &options)
}

/// Returns the reconstructed frames among the JSON lines that a bridge has printed.
fn printed(lines: &str) -> Vec<Frame> {
    let frames = messages(lines, "/neurodata_reconstructed").map(|message| {
        let flags = message["tri"]["data"][0].as_u64();
        (values(&message, "eeg"), flags.expect("a flag word"))
    });
    frames.collect()
}

/// Returns the counts of blocks and bits that the bridge must log if no block is lost.
fn counts(blocks: &[Vec<u8>]) -> String {
    let bytes: usize = blocks.iter().map(Vec::len).sum();
    format!("packed blocks: made {BLOCKS} received {BLOCKS} lost 0 fillers 0 bits {}", 8 * bytes)
}

#[test]
fn packed_blocks_alone_reach_rospy_as_the_library_decodes_them() {
    let test = "packed blocks to rospy";
    if !ros::available(test) {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let rate = format!("--packed-rate={RATE}");
    let options = ["--streams=packed", "--announce=reconstructed", &rate];
    let chain = Chain::start_with(folder.path(), &options);
    let mut subscriber = chain.subscriber_of("/neurodata_reconstructed");
    let duration = SECONDS.to_string();
    let mut board = chain.board(&["--input=synthetic", "--seed=7", "--duration", &duration]);
    assert!(board.wait(SLACK).success(), "{}", board.log());
    // The bridge publishes the last block only when another block or the end of the run comes.
    let due = BLOCKS - 1;
    subscriber
        .wait_until("all frames", SLACK, |subscriber| subscriber.output().lines().count() > due);
    let messages = messages_of(&subscriber);
    let blocks = blocks(0);
    let all: Vec<_> = blocks.iter().map(Some).collect();
    let expected = &expected(&decode(&all))[..due];
    assert_eq!(messages.len(), due);
    for (index, (message, expected)) in (0..).zip(messages.iter().zip(expected)) {
        assert_eq!(u64::from(message.seq), index + 1);
        assert_eq!((message.sr, message.status.window()), (STEP_RATE_HZ, index));
        assert_eq!(message.status.lost, 0);
        let lost = Flags::FILLER | Flags::HEALING | Flags::OVERRUN | Flags::ADC_STATUS_BAD;
        assert_eq!(message.status.flags & u64::from(lost.bits()), 0);
        assert_eq!(message.eeg.count, HOP * ELECTRODES);
        // Allow for the six decimals that the subscriber prints.
        for (value, expected) in message.values.iter().zip(expected) {
            let expected = f64::from(*expected);
            let difference = (value - expected).abs();
            assert!(difference < 2e-6 + 1e-6 * expected.abs(), "{value}");
        }
    }
    for pair in messages.windows(2) {
        assert_eq!(pair[1].status.device_us() - pair[0].status.device_us(), 62_500);
        assert!(pair[1].stamp > pair[0].stamp);
    }
    assert!(chain.messages().is_empty(), "codes were not asked for");
    println!("{} frames, each equal to the library's", messages.len());
    chain.stop();
}

#[test]
fn an_electrode_that_the_user_excludes_is_filled_flagged_and_named() {
    if SUBSTITUTION.is_none() {
        return skipped(
            "packed blocks with an excluded electrode",
            "the model has no table of substitutions",
        );
    }
    let mut labels = model::LABELS.split(' ');
    let excluded = labels.position(|label| label == "Cz").expect("Cz");
    let blocks = blocks(1 << excluded);
    let all: Vec<_> = blocks.iter().map(Some).collect();
    let expected = expected(&decode(&all));
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let port = folder.join("board").display().to_string();
    let mut printing = print_blocks(folder, &port, &["--exclude=Cz"]);
    let ended = board(folder, SECONDS, &format!("pty:{port}")).wait(SLACK);
    assert!(ended.success());
    printing.wait_until("all frames", SLACK, |bridge| {
        // The bridge prints the frame of the last block only when the run ends.
        printed(&bridge.output()).len() + 1 >= expected.len()
    });
    let [lines, log] = printing::stop(printing, folder);
    let (frames, flags): (Vec<_>, Vec<u64>) = printed(&lines).into_iter().unzip();
    assert!(frames == expected, "{} frames", frames.len());
    let counts = counts(&blocks);
    assert!(log.contains(&counts), "{log}");
    assert!(flags.iter().all(|flags| flags & SUBSTITUTED != 0));
    let named = "filled from the others: Cz";
    assert!(messages(&lines, "/diagnostics").any(|report| report.to_string().contains(named)));
}

#[test]
fn a_recording_of_packed_blocks_is_replayed_and_converted() {
    let blocks = blocks(0);
    let all: Vec<_> = blocks.iter().map(Some).collect();
    let expected = expected(&decode(&all));
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let rate = format!("--packed-rate={RATE}");
    let options = ["--streams=packed", &rate];
    let [log, replay_log, lines] = printing::record_and_replay(folder, SECONDS, &options, &options);
    let counts = counts(&blocks);
    assert!(log.contains(&counts), "{log}");
    let counts = format!("played 0 codes and {BLOCKS} packed blocks");
    assert!(replay_log.contains(&counts), "{replay_log}");
    let (frames, flags): (Vec<_>, Vec<u64>) = printed(&lines).into_iter().unzip();
    assert!(frames == expected, "{} frames", frames.len());
    assert!(flags.iter().all(|flags| flags & SUBSTITUTED == 0));
    let table = Table::read(&folder.join("run.reconstructed.csv"));
    let labels: Vec<&str> = model::LABELS.split(' ').collect();
    let rows: Vec<f32> = table.numbers(&labels).flatten().collect();
    assert!(rows == expected.concat(), "{} values", rows.len());
}

#[test]
fn after_lost_frames_every_frame_is_that_of_a_decoder_with_the_same_losses() {
    let blocks = blocks(0);
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let port = free_port().expect("a free port");
    let board = board(folder, SECONDS, &format!("tcp:127.0.0.1:{port}"));
    let cable = LossyCable::new(port, 5).expect("a connection");
    let mut printing = print_blocks(folder, &cable.port, &["--low-latency"]);
    printing.wait_until("most frames", SLACK, |bridge| {
        printed(&bridge.output()).len() + 8 >= blocks.len()
    });
    std::thread::sleep(Duration::from_millis(500));
    drop(board);
    let [lines, _] = printing::stop(printing, folder);
    let frames = printed(&lines);
    assert!(frames.len() <= blocks.len());
    let has = |flags: u64, flag: Flags| flags & u64::from(flag.bits()) != 0;
    let received: Vec<_> = frames
        .iter()
        .zip(&blocks)
        .map(|((_, flags), block)| (!has(*flags, Flags::FILLER)).then_some(block))
        .collect();
    let lost = received.iter().filter(|block| block.is_none()).count();
    println!("{lost} of {} blocks lost", frames.len());
    assert!(lost > 0 && lost < frames.len());
    let decoded = decode(&received);
    for (index, ((values, flags), decoded)) in frames.iter().zip(&decoded).enumerate() {
        assert!(*values == decoded.microvolts, "block {index}");
        let is_healing = received[index].is_some() && !decoded.is_sound;
        assert_eq!(has(*flags, Flags::HEALING), is_healing, "block {index}");
    }
}
