"""The air of a scene: what follows from what was said of it."""

from jaxtyping import Array, Float

from jblast.scene.air import Air
from jblast.waves.propagation.atmosphere import sound_speed_in_air, standard_atmosphere


def ambient(air: Air) -> tuple[Float[Array, ""], Float[Array, ""]]:
    """Return temperature [K] and pressure [Pa]: as said, or of the altitude."""
    if air.altitude is None:
        return air.temperature, air.pressure
    return standard_atmosphere(air.altitude)


def sound_speed_of(air: Air) -> Float[Array, ""]:
    """Return the speed of sound [m/s]: as said, or by temperature and humidity."""
    if air.sound_speed is not None:
        return air.sound_speed
    temperature, pressure = ambient(air)
    return sound_speed_in_air(temperature, pressure, air.relative_humidity)
