"""Runs a ROS 2 launch file without ROS, and prints what it starts.

    launch_arguments.py FILE NAME:=VALUE...

Prints {"declared": [NAME...], "node": {...}}, with what the file gives its node.
"""

import json
import runpy
import sys
import types


class Action:
    """An action of launch, which keeps what it is given."""

    def __init__(self, *values, **named):
        self.values = values
        self.named = named


class Configuration(Action):
    """An argument of the launch file."""

    def perform(self, context):
        """Returns the argument's value."""
        return context[self.values[0]]


def module(name, **members):
    """Makes a module of this name."""
    sys.modules[name] = types.ModuleType(name)
    vars(sys.modules[name]).update(members)


module("launch", LaunchDescription=Action)
module("launch.actions", DeclareLaunchArgument=Action, OpaqueFunction=Action)
module("launch.substitutions", LaunchConfiguration=Configuration)
module("launch_ros")
module("launch_ros.actions", Node=Action)

path, *given = sys.argv[1:]
(actions,) = runpy.run_path(path)["generate_launch_description"]().values
*declared, start = actions
context = {argument.values[0]: argument.named["default_value"] for argument in declared}
context.update(pair.split(":=") for pair in given)
(node,) = start.named["function"](context)
print(json.dumps({"declared": [argument.values[0] for argument in declared], "node": node.named}))
