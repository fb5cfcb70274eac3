r"""Departure of far readings from laws of still, uniform air.

Past a scaled distance of 200 to 300 m/kg^(1/3) recorded peaks, impulses and durations
leave the laws for a weak shock: the median peak is half of theirs, and readings of one
shot scatter by a factor of 1.6. Wind and temperature bend the rays, turbulence and
terrain scatter them. Absorption is no explanation: by ISO 9613-1 it takes at most 0.5 %
of the peaks recorded there (175 to 744 kg; `calibration/far_pressure.py`). Two parts
are added to the scatter in ln that a law has near the charge:

$$\sigma_{far} = F\,g(Z), \qquad \sigma_{record} = R\,g(Z), \qquad
  g(Z) = \frac{1}{1 + (Z_k/Z)^4}$$

The far rows of one shot share the first: its weather. It includes the median loss,
since the sign depends on the weather: downwind, peaks rise. It is independent of the
level of the shot near the charge. The second is that of each record, the scale of a
Student-t with 4 degrees of freedom. Both are bounded; a scatter without bound would let
any distant reading agree with any mass.

The scatter keeps far rows from outweighing near ones. It does not make a mass from far
rows alone reliable, so the range of these laws ends at Z = 300: masses of held-out
shots from peaks past 300 alone are too small, and 3 of 8 intervals of 90 % contain the
true one (none with the scatter near the charge). A heavier charge would put the rows
nearer, where the laws hold and the recorded peaks would contradict them; that the knee
is at one Z for all masses and weathers is more than four campaigns can show.

The numbers stand in `data/far_scatter.json`, estimated by `calibration/far_pressure.py`
from 189 records of 18 chemical shots, Z = 22 to 838 m/kg^(1/3).
"""

import json
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from jaxtyping import Array, ArrayLike, Float

from jblast.constants import STANDARD_PRESSURE
from jblast.types import as_float_array
from jblast.waves.scaling import scaled_distance

FAR_END = 300.0
"""Scaled distance where laws for still, uniform air end, for peak, impulse and duration
[m/kg^(1/3)]. Recorded peaks over the law, each shot over its own level: the median is
0.97 to 1.04 in all bins up to here and 0.50 from 300 to 450
(`calibration/results/far_pressure.txt`)."""

EXPONENT = 4.0
"""Of $Z_k/Z$. The likelihoods of 2, 4 and 8 are printed by the calibration; 8 fits the
peaks somewhat better, and would make the scatter a step at one site's weather."""


class FarScatter(NamedTuple):
    """Scatter of one quantity far away.

    Attributes:
        shared: $F$, of what the far rows of a shot share [ln].
        record: $R$, scale of each record [ln].
        knee: $Z_k$, where both have half their size [m/kg^(1/3)].
    """

    shared: float
    record: float
    knee: float

    def at(
        self, z: Float[ArrayLike, "..."]
    ) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
        """Return both standard deviations in ln at a scaled distance."""
        # Of Z/Z_k, not of its inverse: the power is finite at Z = 0, and so its slope.
        power = (as_float_array(z) / self.knee) ** EXPONENT
        share = power / (1.0 + power)
        return self.shared * share, self.record * share


@cache
def _packaged() -> dict[str, FarScatter]:
    data = files("jblast.waves") / "data" / "far_scatter.json"
    numbers = json.loads(data.read_text(encoding="utf-8"))["quantities"]
    return {quantity: FarScatter(**each) for quantity, each in numbers.items()}


def measured_far_scatter(quantity: str) -> Callable[..., tuple]:
    """Return the far scatter of a quantity, for `registry.Law.far_scatter`.

    Args:
        quantity: "peak_overpressure_pa", "positive_impulse_pa_s" or
            "positive_duration_s".
    """

    def far_scatter(
        slant_range: Float[ArrayLike, "..."],
        charge_mass: Float[ArrayLike, "..."],
        ambient_pressure: Float[ArrayLike, "..."] = STANDARD_PRESSURE,
    ) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
        z = scaled_distance(slant_range, charge_mass, ambient_pressure)
        return _packaged()[quantity].at(z)

    return far_scatter
