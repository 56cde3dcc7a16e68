//! Debian's ROS tools work with the master of `corticode-bridge`, without roscore.

use acceptance::chain::{Chain, NEURO_FRAME_MD5};
use acceptance::process::SLACK;
use acceptance::ros;

/// Duration of the EEG that the board encodes, in seconds.
const SECONDS: usize = 5;
/// Number of codes that the board sends per second.
const RATE: usize = 16;

#[test]
fn rospy_rosbag_and_rostopic_receive_every_code_at_the_programs_own_master() {
    if !ros::available("the ROS tools at the master of corticode-bridge") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut chain = Chain::start_without_roscore(folder.path());
    let duration = SECONDS.to_string();
    let mut board = chain.board(&["--input=synthetic", "--duration", &duration]);
    chain.wait_for(RATE);
    let topics = chain.ros.tool("rostopic", &["list"]);
    assert!(topics.lines().any(|topic| topic == "/encoded"), "{topics}");
    let echo = chain.ros.tool("rostopic", &["echo", "-n1", "/encoded"]);
    assert!(echo.contains("nchannels: 128"), "{echo}");
    let info = chain.ros.tool("rosservice", &["call", "/acquisition/get_info"]);
    assert!(info.contains("result: True"), "{info}");
    chain.ros.tool("rosparam", &["set", "/lesson", "7"]);
    assert_eq!(chain.ros.tool("rosparam", &["get", "/lesson"]).trim(), "7");

    let ended = board.wait(SLACK);
    assert!(ended.success(), "{}", board.log());
    // The first window takes two hops, so n hops of EEG give n - 1 codes.
    let codes = SECONDS * RATE - 1;
    chain.wait_for(codes);
    assert_eq!(chain.messages().len(), codes);
    let bag = chain.stop();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
    assert!(bag.contains(&format!("{codes} msgs")), "{bag}");
}
