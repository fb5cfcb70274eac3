"""Where should the weak-shock tail take over from the Kingery-Bulmash pressure?

Run `python -m calibration.kinematics_tail`. Data: jblast/waves/data/kingery_bulmash.csv
(its provenance stands there). No random numbers.

The last stretch of the polynomials wiggles: on the surface their slope is -1.25 at
Z = 20 and -1.40 at 30, while a weak shock only flattens, towards -1. A tail joined at
40 takes the wiggle for physics: at Z = 400 its pressure is 25 % lower on the surface,
about a factor of 2 in the mass read from it (6 % in free air). So `shock_kinematics`
joins at 20. What this changes inside the table, Z = 20 to 40, is in the column "20/KB":
up to 10 % at Z = 40 on the surface, 6 % in free air.
"""

import jax
import jax.numpy as jnp

from jblast.waves.laws.kingery_bulmash import kingery_bulmash_curve
from jblast.waves.shock import weak_shock_tail

SCALED_DISTANCES = (20.0, 25.0, 30.0, 35.0, 40.0, 400.0)


def main() -> None:
    """Print the table for both bursts."""
    jax.config.update("jax_enable_x64", True)
    for burst in ("surface", "free-air"):
        curve = kingery_bulmash_curve("incident_pressure", burst)
        tails = {join: weak_shock_tail(curve.segments[-1], join) for join in (20, 40)}
        for join, tail in tails.items():
            print(
                f"{burst}, joined at Z = {join}: A = {tail.amplitude:.1f} Pa "
                f"m/kg^(1/3), b = {tail.length:.5f} m/kg^(1/3)"
            )
        print("      Z     KB [Pa]  slope    at 20    at 40   20/KB   40/KB   40/20")
        for z in SCALED_DISTANCES:
            log_z = jnp.log(z)
            plain = jnp.exp(curve.log_value(log_z))
            slope = jax.grad(curve.log_value)(log_z)
            at_20, at_40 = (jnp.exp(tails[j].log_pressure(log_z)) for j in (20, 40))
            print(
                f"{z:7.0f} {plain:11.2f} {slope:6.3f} {at_20:8.2f} {at_40:8.2f} "
                f"{at_20 / plain:7.4f} {at_40 / plain:7.4f} {at_40 / at_20:7.4f}"
            )
        print(f"(past Z = {curve.z_max:.0f} KB is its power-law continuation)\n")


if __name__ == "__main__":
    main()
