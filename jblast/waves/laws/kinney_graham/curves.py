r"""Kinney's and Graham's curves in scaled terms: 1 kg of TNT in standard air.

$$\frac{p}{P_0} = \frac{808\,[1 + (Z/4.5)^2]}{\sqrt{1 + (Z/0.048)^2}
  \sqrt{1 + (Z/0.32)^2} \sqrt{1 + (Z/1.35)^2}}$$
$$t_d = \frac{980\,[1 + (Z/0.54)^{10}]}{[1 + (Z/0.02)^3] [1 + (Z/0.74)^6]
  \sqrt{1 + (Z/6.9)^2}} \; \mathrm{ms}$$
$$i = \frac{0.067 \sqrt{1 + (Z/0.23)^4}}{Z^2 \sqrt[3]{1 + (Z/1.55)^3}} \;
  \mathrm{bar\,ms}$$

`laws.py` says where they come from, how far they hold, and scales them.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jblast.waves.curves.broken_power_law import Break, BrokenPowerLaw

RELATIVE_PRESSURE = BrokenPowerLaw(
    808.0,
    0.0,
    (
        Break(4.5, 2.0, 1.0),
        Break(0.048, 2.0, -0.5),
        Break(0.32, 2.0, -0.5),
        Break(1.35, 2.0, -0.5),
    ),
)
"""Overpressure over the ambient pressure."""

DURATION = BrokenPowerLaw(
    0.980,
    0.0,
    (
        Break(0.54, 10.0, 1.0),
        Break(0.02, 3.0, -1.0),
        Break(0.74, 6.0, -1.0),
        Break(6.9, 2.0, -0.5),
    ),
    z_min=0.5,
    z_max=300.0,
)
"""Seconds for 1 kg.

Cut where it turns up towards the charge, and where it has become constant to 0.05 % a
factor e: past that its tenth power would cost single precision its digits.
"""

IMPULSE = BrokenPowerLaw(
    6.7, -2.0, (Break(0.23, 4.0, 0.5), Break(1.55, 3.0, -1.0 / 3.0))
)
"""Pa s for 1 kg: 1 bar ms = 100 Pa s."""


def kinney_graham_mach_number(log_z: Float[Array, "..."]) -> Float[Array, "..."]:
    r"""Return U/c by Rankine and Hugoniot: $\sqrt{1 + \tfrac67\, p/P_0}$."""
    relative = jnp.exp(RELATIVE_PRESSURE.log_value(log_z))
    return jnp.sqrt(1.0 + 6.0 / 7.0 * relative)
