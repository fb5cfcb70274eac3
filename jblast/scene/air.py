"""Measured properties of the air; `waves.propagation` derives the others from them."""

import equinox as eqx
from jaxtyping import Array, Float

from jblast.parameter_table import PARAMETERS
from jblast.types import as_float_array, as_optional_float_array


class Air(eqx.Module):
    """Air, the same everywhere.

    Attributes:
        temperature: Temperature [K].
        pressure: Ambient pressure [Pa].
        relative_humidity: Fraction, 0 to 1.
        altitude: Height above sea level [m]; where given, temperature and pressure
            are those of the standard atmosphere there and the two above unused.
        sound_speed: Measured or fitted sound speed [m/s]; None derives it from
            temperature and humidity.
        wind_east: Speed of the air towards east [m/s].
        wind_north: Towards north [m/s].
        absorption: Whether it absorbs sound within the range of a pressure law, too,
            whose peaks hold what it absorbed where they were measured.
        absorption_scale: Nepers a metre of this air over those of ISO 9613-1 [-].
    """

    temperature: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=PARAMETERS["air_temperature_k"].default
    )
    pressure: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=PARAMETERS["air_pressure_pa"].default
    )
    relative_humidity: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=PARAMETERS["air_relative_humidity"].default
    )
    altitude: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    sound_speed: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )
    wind_east: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    wind_north: Float[Array, ""] = eqx.field(converter=as_float_array, default=0.0)
    absorption: bool = eqx.field(static=True, default=False)
    absorption_scale: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=1.0
    )
