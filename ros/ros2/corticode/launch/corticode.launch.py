"""Starts corticode-bridge as the node `acquisition`.

An argument with the value `default` sets no option: the bridge then takes its environment, its
configuration file or its own default.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

# Options of the bridge, `--NAME` with dashes.
OPTIONS = {
    "port": "Port of the board: auto for the only one on USB, auto:SERIAL, a serial port, or tcp:HOST:PORT",
    "announce": "Stream that acquisition/get_info describes: encoded, reconstructed, raw, filtered",
    "streams": "Streams of the board, comma-separated: codes, packed, raw, filtered, audit, events, features",
    "packed_rate": "Rate of the packed code, 0 to 15; one more is 3 dB coarser",
    "raw_form": "Form in which the board sends the samples of raw: any, compressed or plain",
    "mains": "Mains frequency that the board removes: 50 or 60 Hz",
    "filler": "Replacement of lost data: last, zeros, off",
    "event_stamps": "Time that event stamps refer to: recorder, or scalp for the time itself",
    "stamp": "Point of a frame that its stamp refers to; see corticode-bridge --help",
    "exclude": "Electrodes to exclude always, such as Fp1,Fp2",
    "never_exclude": "Electrodes to exclude never",
    "find_bad": "false: exclude no electrode because it looks bad",
    "impedance": "true measures the impedance of the electrodes while it streams",
    "series_ohms": "Resistors of the board in series with each electrode, ohms",
    "low_latency": "true reconstructs from the newest window or packed block alone, 62.5 ms earlier",
    "model": "Folder of the model to decode with, instead of the built-in one",
    "upload_model": "Folder of a model whose packed code the board is to use; overrides model",
    "subject": "Person whose newest model of corticode-bridge calibrate the board is to use; overrides model",
    "classifier": "File of trainer classify; a prediction for each hop is published",
    "prediction_topic": "Topic of the predictions",
    "prediction_window": "Seconds over which band powers are averaged",
    "realtime": "true asks Linux for real-time priority, so that other programs do not delay frames",
    "lsl_name": "First part of the names of the streams of the Lab Streaming Layer",
    "liblsl": "File of liblsl, if it is not where the system or pylsl has it",
    "view_address": "Address and port of the live page, such as 127.0.0.1:8061",
    "view_token": "Token of the live page; by default a new one after each start",
    "record_dir": "Folder for the recordings that the live page starts; an absolute path",
    "baud": "Baud rate of a serial port; USB ignores it",
    "config": "File of options in TOML, which these arguments override",
    "ros_domain_id": "Domain of the node; by default that of ROS_DOMAIN_ID",
    "ros2_qos": "Delivery of frames: reliable or sensor-data",
}
# Further arguments, each with its default.
OTHERS = {
    "ns": ("/", "Namespace of the node, its topics and services, such as left for /left/encoded"),
    "sink": ("ros2", "Outlets, comma-separated: ros2, view, lsl; without ros2 there are no topics"),
    "log": ("info", "Least level of the log: error, warn, info, debug"),
    "respawn": ("true", "Start the bridge again whenever it ends, also after ~/quit"),
    "respawn_delay": ("2", "Seconds between the end of the bridge and its next start"),
}


def start(context):
    """Returns the node with the options that are set."""
    value = {name: LaunchConfiguration(name).perform(context) for name in [*OPTIONS, *OTHERS]}
    given = [name for name in OPTIONS if value[name] != "default"]
    options = [f"--{name.replace('_', '-')}={value[name]}" for name in given]
    node = Node(
        package="corticode",
        executable="corticode-bridge",
        name="acquisition",
        namespace=value["ns"],
        arguments=[f"--sink={value['sink']}", *options],
        additional_env={"RUST_LOG": value["log"]},
        output="screen",
        respawn=value["respawn"] == "true",
        respawn_delay=float(value["respawn_delay"]),
    )
    return [node]


def generate_launch_description():
    """Declares the arguments, and starts the node."""
    declared = [
        DeclareLaunchArgument(name, default_value="default", description=text)
        for name, text in OPTIONS.items()
    ]
    declared += [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in OTHERS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=start)])
