"""Differentiable blast physics: fit blasts from recordings, or simulate them.

    import jblast

    answer = jblast.fit("log.csv", "scene.toml")

The most common functions and classes are names of the package and are imported at their
first use: `import jblast` itself starts neither JAX nor NumPy. The others are imported
from their folders. In the order of the physics these are `scene` (charge, air, ground,
sensors), `waves` (laws of propagation), `observations` (measurements), `sensors`
(simulated measurements), `inference` (fits) and `report` (printed answers).
"""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

# Type checkers and editors see the names, which only exist at their first use.
if TYPE_CHECKING:
    from jblast.discovery import discover_law as discover_law
    from jblast.inference import (
        bound as bound,
        fit as fit,
        fit_each as fit_each,
        fit_many as fit_many,
    )
    from jblast.observations import read as read
    from jblast.scene import Charge as Charge, Scene as Scene, read_scene as read_scene
    from jblast.sensors import (
        calculate as calculate,
        record as record,
        simulate as simulate,
    )
    from jblast.sensors.camera import events as events, render as render
    from jblast.signals import detect as detect
    from jblast.signals.picks import pick as pick, pick_files as pick_files
    from jblast.study.flights import fly as fly
    from jblast.waves.choice import choose as choose

__version__ = "0.2.0"

__all__ = [
    "Charge",
    "Scene",
    "bound",
    "calculate",
    "choose",
    "detect",
    "discover_law",
    "events",
    "fit",
    "fit_each",
    "fit_many",
    "fly",
    "pick",
    "pick_files",
    "read",
    "read_scene",
    "record",
    "render",
    "simulate",
]


__getattr__, __dir__ = lazy_face(__name__)
