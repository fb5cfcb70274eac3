"""Logs of one blast heard by six sensors, one clock of which may be off."""

import numpy as np

from jblast.inference import Fit
from jblast.observations import Observations
from jblast.scene import default_scene, freed, with_laws
from jblast.waves import kingery_bulmash_arrival_time, kingery_bulmash_pressure
from tests.inference.logs import log

PLACES = ((60, 0), (-70, 30), (0, 90), (20, -80), (120, 100), (-110, -60))
NAMES = "abcdef"
MASS = 20.0
SOUND_SPEED = 340.76
"""Of the default air [m/s]."""
QUANTITIES = {
    "arrivals": ("air_arrival_s",),
    "both": ("air_arrival_s", "peak_overpressure_pa"),
}
ASKED = freed(
    with_laws(
        default_scene(),
        {"air_arrival_s": "kingery_bulmash", "peak_overpressure_pa": "kingery_bulmash"},
    ),
    ["origin_time_s", "charge_east_m", "charge_north_m"],
)


def heard(
    kind: str,
    rng: np.random.Generator,
    *,
    clock: dict[str, float] | None = None,
    gain: dict[str, float] | None = None,
) -> Observations:
    """Draw a log as the errors of a fit say: shared normal, the rest Student-t.

    Args:
        kind: Of `QUANTITIES`.
        rng: Of the place and the errors.
        clock: By how much sensors' clocks are ahead [s].
        gain: By which factor sensors' pressures are off.
    """
    east, north = rng.uniform(-40, 40, 2)
    shot = dict(
        zip(("time", "pressure"), rng.standard_normal(2) * (0.01, 0.1), strict=True)
    )
    rows = []
    for name, (x, y) in zip(NAMES, PLACES, strict=True):
        r = float(np.hypot(x - east, y - north))
        travel = float(kingery_bulmash_arrival_time(r, MASS, 101325.0, SOUND_SPEED))
        error = np.hypot(1e-3, 0.01 * travel) * rng.standard_t(4)
        late = (clock or {}).get(name, 0.0)
        value = 2.0 + travel * (1 + shot["time"]) + error + late
        rows.append((name, "air_arrival_s", value, 1e-3, (x, y, 0.0)))
        if kind == "both":
            peak = float(kingery_bulmash_pressure(r, MASS))
            error = np.hypot(0.05, 0.1) * rng.standard_t(4) + shot["pressure"]
            value = peak * np.exp(error) * (gain or {}).get(name, 1.0)
            rows.append(
                (name, "peak_overpressure_pa", value, 0.05 * value, (x, y, 0.0))
            )
    return log(*rows)


def accused(found: Fit) -> list[str]:
    """Return who is said to explain a log."""
    return [entry.name for entry in found.summary.explained_by]
