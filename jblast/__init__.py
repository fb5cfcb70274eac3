"""Differentiable blast physics: fit a blast from recordings, or simulate millions.

    import jblast

    answer = jblast.fit(jblast.read("log.csv"), jblast.read_scene("scene.toml"))

What is asked for most often stands here, imported when it is used: `import jblast`
itself starts neither JAX nor NumPy. The rest has its path in the folders; in this order
they tell the physics: `scene` what is there, `waves` how it travels, `observations`
what was measured, `sensors` what would be, `inference` what we conclude, `report` what
we print.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jblast.fidelity import choose as choose
    from jblast.inference import bound as bound, fit as fit, fit_many as fit_many
    from jblast.observations import read as read
    from jblast.scene import Charge as Charge, Scene as Scene, read_scene as read_scene
    from jblast.sensors import (
        calculate as calculate,
        record as record,
        simulate as simulate,
    )
    from jblast.sensors.camera import events as events, render as render
    from jblast.signals.picks import pick as pick
    from jblast.study.flights import fly as fly

__version__ = "0.2.0"

__all__ = [
    "Charge",
    "Scene",
    "bound",
    "calculate",
    "choose",
    "events",
    "fit",
    "fit_many",
    "fly",
    "pick",
    "read",
    "read_scene",
    "record",
    "render",
    "simulate",
]

_HOMES = {
    "Charge": "jblast.scene",
    "Scene": "jblast.scene",
    "bound": "jblast.inference",
    "calculate": "jblast.sensors",
    "choose": "jblast.fidelity",
    "events": "jblast.sensors.camera",
    "fit": "jblast.inference",
    "fit_many": "jblast.inference",
    "fly": "jblast.study.flights",
    "pick": "jblast.signals.picks",
    "read": "jblast.observations",
    "read_scene": "jblast.scene",
    "record": "jblast.sensors",
    "render": "jblast.sensors.camera",
    "simulate": "jblast.sensors",
}


def __getattr__(name: str) -> Any:
    """Import a name when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Name also what is not imported yet."""
    return sorted({*globals(), *__all__})
