//! The command for the rate of the packed code.

use super::*;

#[test]
fn a_rate_is_ordered_at_any_time_if_it_exists_and_the_device_has_packed_codes() {
    let (mut session, mut sender) = board(EVERYTHING);
    let mut answer = |rate| execute(&mut session, &mut sender, ToDevice::SetRate { rate });
    let order = |rate| Rate::new(rate).map(Order::SetRate);
    assert_eq!(answer(0), (order(0), AckResult::Done));
    assert_eq!(answer(15), (order(15), AckResult::Done));
    assert_eq!(answer(16), (None, AckResult::BadArgument));
    execute(&mut session, &mut sender, start(Streams::PACKED));
    let running = execute(&mut session, &mut sender, ToDevice::SetRate { rate: 2 });
    assert_eq!(running, (order(2), AckResult::Done));
    let (mut session, mut sender) = board(Abilities::CODES);
    let answer = execute(&mut session, &mut sender, ToDevice::SetRate { rate: 4 });
    assert_eq!(answer, (None, AckResult::NotSupported));
}
