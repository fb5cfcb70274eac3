"""What a choice of method depends on, from a charge to some places."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jblast.fidelity import solver
from jblast.kept_programs import kept
from jblast.registry import call, law_for, names_for
from jblast.scene.charge import Burst
from jblast.waves.paths import Path
from jblast.waves.scaling import scaled_distance
from jblast.waves.shock import FAR_END

Numbers = Float[Array | np.ndarray, " place"]
Marks = Bool[Array | np.ndarray, " place"]


class Conditions(eqx.Module):
    """What a choice of method is conditioned on, by place.

    Attributes:
        z: Scaled distance [m/kg^(1/3)].
        slant_range: Distance from the charge [m].
        charge_mass: TNT-equivalent mass [kg].
        ambient_pressure: $P_0$ [Pa].
        sound_time: What sound takes to get there [s].
        scaled_height: Height of burst over the same length as Z [m/kg^(1/3)].
        holds: By method, whether it holds there.
        burst: "surface" or "free-air".
    """

    z: Numbers
    slant_range: Numbers
    charge_mass: Numbers
    ambient_pressure: Numbers
    sound_time: Numbers
    scaled_height: Numbers
    holds: dict[str, Marks]
    burst: Burst = eqx.field(static=True)


def conditions_of(quantity: str, path: Path) -> Conditions:
    """Return what decides over the methods for a quantity; may be jitted.

    Args:
        quantity: What is asked for.
        path: To every place; the mass is that of TNT.
    """

    def each(number):
        return jnp.broadcast_to(number, path.slant_range.shape)

    z = scaled_distance(path.slant_range, path.charge_mass, path.ambient_pressure)
    holds = {
        name: call(law_for(quantity, name).valid, path) for name in names_for(quantity)
    }
    if quantity in solver.SOLVED:
        here = solver.holds(z, path.one_burst())
        if quantity == "peak_overpressure_pa":  # of still air, as the laws are
            here = here & (z <= FAR_END)
        holds[solver.METHOD] = here
    return Conditions(
        z=z,
        slant_range=path.slant_range,
        charge_mass=each(path.charge_mass),
        ambient_pressure=each(path.ambient_pressure),
        sound_time=path.slant_range / path.sound_speed,
        scaled_height=z * path.height_of_burst / path.slant_range,
        holds={name: each(where) for name, where in holds.items()},
        burst=path.one_burst(),
    )


jitted_conditions = kept(conditions_of)
