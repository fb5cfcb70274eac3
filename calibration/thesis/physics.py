"""Physics of the thesis; importing this module registers its laws."""

from collections.abc import Callable
from typing import Any, NamedTuple

from calibration.thesis import laws as laws
from calibration.thesis.loads import coded_load, printed_load

SOUND = ("peak_overpressure_pa", "positive_duration_s", "positive_impulse_pa_s")


class Physics(NamedTuple):
    """Physics of a blast in place of jblast's.

    Attributes:
        tables: Tables of a scene file.
        load: Function from a scene to the load of its blasts on the vehicle.
        pressure_speed_m_s: Speed of pressure and force; None: that of sound.
    """

    tables: dict[str, dict[str, Any]]
    load: Callable[..., Any]
    pressure_speed_m_s: float | None = None

    @property
    def toml(self) -> str:
        """The tables as text, which follows that of a scene without them."""
        lines = []
        for name, keys in self.tables.items():
            lines.append(f"\n[{name}]")
            for key, value in keys.items():
                text = str(value).lower() if isinstance(value, bool) else repr(value)
                lines.append(f"{key} = {text}")
        return "\n".join(lines) + "\n"


def _physics(name: str, path: str, **others: Any) -> Physics:
    arrivals = dict.fromkeys(("air_arrival_s", "ground_arrival_s"), "wu_hao")
    tables = {
        # the thesis's speed of sound "in dry air at 20 C"; its laws have absorption
        "air": {"sound_speed_m_s": 340.0, "absorption": False},
        "ground": {"p_speed_m_s": 6000.0, "path": path},
        "law": {**arrivals, **dict.fromkeys(SOUND, name), "scatter": False},
    }
    return Physics(tables, **others)


PRINTED = _physics("thesis_as_printed", "head", load=printed_load)
CODED = _physics("thesis_as_coded", "thesis", load=coded_load, pressure_speed_m_s=300.0)
