"""Types of ROS 2 messages for Cyclone DDS, made from their definitions: ROS 2-Neuro's in
`ros/ros2/`, others in the installed Python packages of ROS 2.
"""

import sys
from pathlib import Path

from cyclonedds.idl import make_idl_struct, types

OURS = Path(__file__).parents[3] / "ros" / "ros2"
INSTALLED = Path(sys.prefix) / "share"
NUMBERS = {
    name: getattr(types, name)
    for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64")
}
SIMPLE = {**NUMBERS, "string": str, "bool": bool, "byte": types.uint8}
made = {}


def type_of(name, package):
    """Returns the type that a field of `package` calls `name`."""
    if name.endswith("[]"):
        return types.sequence[type_of(name[:-2], package)]
    if name in SIMPLE:
        return SIMPLE[name]
    return struct(name if "/" in name else f"{package}/{name}")


def struct(name):
    """Returns the type PACKAGE/TYPE."""
    if name not in made:
        package, short = name.split("/")
        fields = fields_of(definition(package, "msg", short), package)
        made[name] = make_idl_struct(short, f"{package}::msg::dds_::{short}_", fields)
    return made[name]


def definition(package, kind, name):
    """Returns the text that defines PACKAGE/NAME, a "msg" or a "srv"."""
    folder = OURS if (OURS / package).is_dir() else INSTALLED
    return (folder / package / kind / f"{name}.{kind}").read_text()


def fields_of(text, package):
    """Returns the fields that the text defines, by name."""
    lines = (line.split("#")[0].split() for line in text.splitlines())
    return {words[1]: type_of(words[0], package) for words in lines if words and "=" not in words[1]}


def plain(value):
    """Returns the value with structures as dictionaries."""
    if hasattr(value, "__idl__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value
