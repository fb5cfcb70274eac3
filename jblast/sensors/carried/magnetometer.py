r"""A magnetometer on a vehicle, in a field that is the same everywhere near its place.

Where nothing is said the field is the Earth's dipole at the latitude and longitude of
the scene, the first three of the coefficients of IGRF-14 (epoch 2025: $g_1^0 = -29350$,
$g_1^1 = -1410.3$, $h_1^1 = 4545.5$ nT). What it leaves out is a tenth of the field and
up to some 15 degrees of its direction: enough for an autopilot that is told the same
field, not for one that looks it up.
"""

import math

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from jblast.scene import quaternion_matrix
from jblast.types import as_float_array

DIPOLE_GAUSS = (-0.29350, -0.014103, 0.045455)
"""$g_1^0, g_1^1, h_1^1$ of IGRF-14 at 2025.0."""


class Magnetometer(eqx.Module):
    """A magnetometer.

    Attributes:
        field_gauss: Of the place: east, north, up.
        rate: Samples a second [Hz].
        noise: One standard deviation of an axis of a sample [gauss]; declared, of an
            IST8310 (data sheet: 0.3 uT of resolution) three times over.
    """

    field_gauss: Float[Array, "3"] = eqx.field(converter=as_float_array)
    rate: float = eqx.field(static=True, converter=float, default=50.0)
    noise: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.009)

    def __check_init__(self):
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate:g} Hz")


def dipole_field(lat_deg: float, lon_deg: float) -> Float[np.ndarray, "3"]:
    r"""Return the field of the Earth's dipole at sea level: east, north, up [gauss].

    Less the gradient of
    $\frac{a^3}{r^2}\,(g_1^0\sin\phi + (g_1^1\cos\lambda + h_1^1\sin\lambda)\cos\phi)$
    at $r = a$.

    Args:
        lat_deg: Latitude, taken as geocentric [degree].
        lon_deg: Longitude [degree].
    """
    g_0, g_1, h_1 = DIPOLE_GAUSS
    lat, lon = math.radians(lat_deg), math.radians(lon_deg)
    across = g_1 * math.cos(lon) + h_1 * math.sin(lon)
    east = g_1 * math.sin(lon) - h_1 * math.cos(lon)
    north = -g_0 * math.cos(lat) + across * math.sin(lat)
    up = 2 * (g_0 * math.sin(lat) + across * math.cos(lat))
    return np.array([east, north, up])


def field_read(
    noise: Float[Array, "3"], magnetometer: Magnetometer, quaternion: Float[Array, "4"]
) -> Float[Array, "3"]:
    """Return a sample along the body's axes [gauss].

    Args:
        noise: Standard normal numbers.
        magnetometer: Field and noise.
        quaternion: Body to world (x, y, z, w), of length 1.
    """
    true = quaternion_matrix(quaternion).T @ magnetometer.field_gauss
    return true + magnetometer.noise * noise
