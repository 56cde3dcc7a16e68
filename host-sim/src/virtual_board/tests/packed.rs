//! Packed blocks of a virtual board, and their rate.

use link::ResetInto;

use super::*;

const START_PACKED: ToDevice = start(Streams::PACKED);

/// Returns the rates of the packed blocks of one second.
fn rates(board: &mut VirtualBoard, outbox: &Outbox) -> Vec<u8> {
    for _ in 0..model::ADC_RATE_HZ {
        board.process_sample(&Sample::default(), 0);
    }
    frames(outbox, |message| match message {
        ToHost::PackedCode(block) => Some(block.rate),
        _ => None,
    })
}

#[test]
fn every_command_of_one_read_is_executed() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    let mut bytes = Vec::new();
    for command in [START_PACKED, ToDevice::SetRate { rate: 9 }] {
        let mut buffer = [0; MAX_FRAME];
        bytes.extend_from_slice(host.encode(0, &command, &mut buffer).expect("a frame"));
    }
    board.receive(&bytes, 1_000);
    assert_eq!(rates(&mut board, &outbox), [9; 16]);
}

#[test]
fn the_rate_outlives_a_run_and_not_a_reset() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    send(&mut board, &mut host, ToDevice::SetRate { rate: 9 });
    for expected in [9, 9] {
        send(&mut board, &mut host, START_PACKED);
        assert_eq!(rates(&mut board, &outbox)[0], expected);
        send(&mut board, &mut host, ToDevice::Stop);
    }
    send(&mut board, &mut host, ToDevice::Reset(ResetInto::Firmware));
    send(&mut board, &mut Encoder::default(), START_PACKED);
    let of_model = pipeline::PackedEncoder::DEFAULT_RATE.index();
    assert_eq!(rates(&mut board, &outbox)[0], of_model);
}
