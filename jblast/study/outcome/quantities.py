"""Quantities at each sensor without measurement error: times, pressures, impulses.

If the scene's laws have scatter, the values contain it. Each requested quantity is
computed at each sensor, whatever records the sensors specify.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jblast.constants import PSI
from jblast.errors import require
from jblast.quantities import BY_CAMERA, BY_VEHICLE, PLACELESS, QUANTITIES, TIMED
from jblast.scene import Scene, UncertainScene
from jblast.scene.uncertain import with_values
from jblast.scene.values import finite
from jblast.sensors import Layout, planned_layout, record, resolve_laws
from jblast.sensors.law_choice import law_names
from jblast.sensors.simulated_readings import observe
from jblast.study.outcome.family import (
    YES_NO,
    Answers,
    Prepared,
    Setting,
    family,
    yes_no,
)

NOT_AT_SENSORS = {*BY_CAMERA, *BY_VEHICLE, *PLACELESS, *TIMED}
OWN_SIGMA = 1.0
"""Placeholder of a standard error: layouts need one, but no outcome depends on it."""


def planned(
    uncertain: UncertainScene, quantities: tuple[str, ...]
) -> tuple[Scene, Layout, dict[str, str]]:
    """Return scene, rows and laws of quantities at each sensor, in that order.

    Raises:
        InputError: There is no sensor, a sensor has no position, there are several
            charges, or a quantity has no law.
    """
    scene = uncertain.scene
    source = uncertain.source or "scene"
    of = f"for the outcome {quantities[0]}"
    check_sensors(scene, source, of)
    records = tuple((quantity, OWN_SIGMA) for quantity in quantities)
    # the outcomes replace the records that the scene specifies
    sensors = tuple(replace(sensor, records=records) for sensor in scene.sensors)
    layout, _, _ = planned_layout(replace(scene, sensors=sensors))
    shots = 1 + max(layout.shot)
    words = f"one charge {of} at sensors"
    require(shots == 1, f"{source}: [[charge]]", words, len(scene.charges))
    # a layout is sorted by sensor; transposed, each quantity is one slice
    order = np.arange(len(layout.quantity)).reshape(len(sensors), len(quantities)).T
    layout = layout.only(order.ravel())
    laws = law_names(resolve_laws(scene, layout))
    return scene, layout, laws


def check_sensors(scene: Scene, source: str, of: str) -> None:
    """Check that there are sensors, and that each has a position.

    Raises:
        InputError: There is none, or one has no position; `of` names what needs it.
    """
    require(scene.sensors, f"{source}: [[sensor]]", f"at least one {of}", "none")
    for sensor in scene.sensors:
        placed = np.isfinite(np.asarray(sensor.position_m)).all()
        where = f"{source}: [[sensor]] {sensor.name!r} position_m"
        require(placed, where, f"[east, north, up] {of}", "nothing")


class Limit(NamedTuple):
    """Threshold of a quantity.

    Attributes:
        quantity: Quantity at a sensor.
        value: Threshold in the unit of the quantity; None if [options] state it.
        words: Effect above the threshold.
        source: Source of the value.
    """

    quantity: str
    value: float | None
    words: str
    source: str


# The reports themselves were not available. The values were compared with copies:
# Clancey's table at explosion-safety.jp, and quotations of the NIOSH report.
LIMITS = {
    # The same table has 10 % of windows broken at 0.3 psi, and most at 0.5 to 1 psi.
    "above_glass_threshold": Limit(
        "peak_overpressure_pa",
        0.15 * PSI,
        "the typical pressure of glass breakage",
        "0.15 psi: Clancey 1972, table of damage by peak overpressure",
    ),
    # About 1 % of eardrums rupture at this pressure, half of them at 15 psi.
    "above_eardrum_threshold": Limit(
        "peak_overpressure_pa",
        5.0 * PSI,
        "the threshold of eardrum rupture",
        "5 psi: Zipf and Cashdollar 2007, Explosions and refuge chambers, NIOSH",
    ),
    # Blasts of a few milliseconds need two to three times this pressure.
    "above_lung_threshold": Limit(
        "peak_overpressure_pa",
        15.0 * PSI,
        "the threshold of lung damage in long blasts",
        "15 psi: Zipf and Cashdollar 2007, Explosions and refuge chambers, NIOSH",
    ),
    "above_threshold": Limit(
        "peak_overpressure_pa", None, "[options] threshold_pa", "the study"
    ),
}
"""Outcomes by a threshold of a quantity. The share of samples above one is no
probability of damage."""


@family(
    "quantities",
    1,
    {
        name: (
            YES_NO,
            f"whether the peak overpressure is above {limit.words}",
        )
        for name, limit in LIMITS.items()
    }
    | {
        quantity.name: (quantity.unit, f"{quantity.meaning}, at each sensor")
        for quantity in QUANTITIES.values()
        if quantity.name not in NOT_AT_SENSORS
    },
    per_sensor=True,
    needs="[[sensor]]",
    on_core=1 << 16,
    together=1 << 25,
    options={"threshold_pa": "peak overpressure of above_threshold [Pa]"},
)
def prepare(setting: Setting) -> Prepared:
    """Return the prepared quantities at the sensors of a scene (`planned`)."""
    limits = {n: limit_of(n, setting.options) for n in setting.names if n in LIMITS}
    requested = [LIMITS[n].quantity if n in limits else n for n in setting.names]
    quantities = tuple(dict.fromkeys(requested))
    like, layout, laws = planned(setting.uncertain, quantities)
    count = len(like.sensors)
    exact = jnp.zeros(len(layout.quantity))
    # one layout for each quantity: the propagation from charge to sensors is then the
    # same expression in all of them, which XLA computes once
    own_rows = {
        quantity: layout.only(np.arange(n * count, (n + 1) * count))
        for n, quantity in enumerate(quantities)
    }

    def one(key, numbers) -> Answers:
        scene = with_values(like, numbers)
        # scatter is shared by rows: all are drawn together
        if scene.scatter:
            values = observe(key, scene, layout, laws, exact, noise="gaussian")
            rows = {q: values[n * count :][:count] for n, q in enumerate(quantities)}
        else:
            rows = {
                q: record(scene, own, {q: laws[q]}).value for q, own in own_rows.items()
            }
        answers = {name: rows[name] for name in setting.names if name in rows}
        for name, limit in limits.items():
            value = rows[LIMITS[name].quantity]
            # a law without a value is a failed sample, not a "no"
            answers[name] = yes_no(value > limit, ~jnp.isnan(value))
        return answers

    used = tuple(f"{quantity} by {law}" for quantity, law in laws.items())
    limit_notes = tuple(
        f"{name}: above {limit:.4g} Pa ({LIMITS[name].source})"
        for name, limit in limits.items()
    )
    return Prepared(jax.vmap(one), notes=used + limit_notes)


def limit_of(name: str, options: Mapping[str, Any]) -> float:
    """Return the threshold of an outcome, in the unit of its quantity."""
    value = LIMITS[name].value
    if value is not None:
        return value
    where = "[options] threshold_pa"
    require(
        "threshold_pa" in options, where, f"the threshold of {name} [Pa]", "nothing"
    )
    return finite(options["threshold_pa"], where)
