"""What `jblast` can do: the verbs, in groups; a group is a folder, a verb its module.

A table, so that help and one verb need not import the others.
"""

from importlib import import_module
from types import ModuleType
from typing import NamedTuple


class Verb(NamedTuple):
    """A verb of the command line.

    Attributes:
        name: What is typed, and the module's name.
        group: Under which heading the help lists it, one of `GROUPS`; its folder.
        help: What it does, in a line.
    """

    name: str
    group: str
    help: str

    def module(self) -> ModuleType:
        """Import what takes its words (`add_arguments`) and does it (`run`)."""
        return import_module(f"jblast.cli.verbs.{self.group}.{self.name}")


GROUPS = {
    "measure": "from what recorders wrote to a log; what the laws say; a scene",
    "infer": "what a blast was, and what could be told",
    "simulate": "what would be recorded, filmed and flown through",
    "check": "a log before it is fitted; which method will do, where it breaks",
}

VERBS = (
    Verb(
        "pick", "measure", "pick blasts from records of pressure: a log, from samples"
    ),
    Verb("convert", "measure", "write a log in our columns and units, from others"),
    Verb("scene", "measure", "write a commented starter scene for a log"),
    Verb(
        "calc",
        "measure",
        "calculate a blast by every law, or the range or mass for a value",
    ),
    Verb("fit", "infer", "fit a blast to a log of sensor readings"),
    Verb(
        "tune",
        "infer",
        "tune sensors and media to recordings, or a vehicle's gains to blasts",
    ),
    Verb("detect", "infer", "find a blast in sound, film or events, and when it came"),
    Verb("bound", "infer", "say what a planned layout of sensors could tell"),
    Verb(
        "discover",
        "infer",
        "find the equations of motion in a trajectory, and how sure each term is",
    ),
    Verb("simulate", "simulate", "write what a scene's sensors would record"),
    Verb(
        "listen",
        "simulate",
        "write down what every sensor hears and feels over time: sound, pressure, wind",
    ),
    Verb("render", "simulate", "film a scene's blast: frames and events of its camera"),
    Verb(
        "bake", "simulate", "make pictures of an explosion from all sides, by Blender"
    ),
    Verb(
        "events",
        "simulate",
        "turn a sequence of frames into the events of an event camera",
    ),
    Verb(
        "fly",
        "simulate",
        "fly a scene's vehicle through its blasts: deviation, recovery, who flies on",
    ),
    Verb(
        "plan", "simulate", "write a plan for a vehicle: lanes over a field, a circle"
    ),
    Verb(
        "world",
        "simulate",
        "draw random blasts, and write what every sense of a scene perceives of them",
    ),
    Verb(
        "serve",
        "simulate",
        "let other simulators take part in a world, told of its blasts ahead of time",
    ),
    Verb(
        "study",
        "simulate",
        "draw a scene many times over, and ask each sample what came of it",
    ),
    Verb("report", "simulate", "show a world on one page: every sense on one clock"),
    Verb("check", "check", "say everything that is wrong with a log at once"),
    Verb("choose", "check", "name the cheapest method that is good enough for a scene"),
    Verb("chart", "check", "chart speed against accuracy, measured on this machine"),
    Verb(
        "stability",
        "check",
        "measure where each method breaks, and what is done there",
    ),
)
