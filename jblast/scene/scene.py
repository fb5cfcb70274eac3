"""The scene: one argument of the whole physics."""

import equinox as eqx
from jaxtyping import Array, Float

from jblast.parameter_table import PARAMETERS
from jblast.scene.air import Air
from jblast.scene.ambient import Ambient
from jblast.scene.camera import Camera
from jblast.scene.charge import Charge
from jblast.scene.ground import Ground
from jblast.scene.sensor import Clock, Sensor
from jblast.scene.vehicle import VehicleSpec
from jblast.types import as_float_array, as_optional_float_array


class Scene(eqx.Module):
    """Everything that decides what the sensors record.

    Attributes:
        charge: What exploded.
        others: What else exploded, at other times or places; then each has a name.
        air: What the shock travels in.
        ground: What the ground wave travels in.
        sensors: Who listens.
        ambient: What is heard without a blast, if anything.
        camera: Who looks on, if anyone.
        vehicle: What flies there, if anything.
        clocks: Recorders' clocks that need not agree with the common one.
        law: Pairs of quantity and law name; a quantity without one is "auto".
        scatter: Whether the laws scatter about nature, or are exact.
        instant_light: Whether a flash is seen at once, its way left out.
        sedov_gamma: Ratio of specific heats in the Sedov-Taylor law [-].
        fireball_growth: Time constant of fireballs' expansion [s]; None leaves it to
            the law.

    Example:
        `jblast.Scene(jblast.Charge(15.0), air=jblast.scene.Air(altitude=800.0))`
    """

    charge: Charge = eqx.field(default_factory=Charge)
    others: tuple[Charge, ...] = ()
    air: Air = eqx.field(default_factory=Air)
    ground: Ground = eqx.field(default_factory=Ground)
    sensors: tuple[Sensor, ...] = ()
    ambient: Ambient | None = None
    camera: Camera | None = None
    vehicle: VehicleSpec | None = None
    clocks: tuple[Clock, ...] = ()
    law: tuple[tuple[str, str], ...] = eqx.field(static=True, default=())
    scatter: bool = eqx.field(static=True, default=True)
    instant_light: bool = eqx.field(static=True, default=False)
    sedov_gamma: Float[Array, ""] = eqx.field(
        converter=as_float_array, default=PARAMETERS["sedov_gamma"].default
    )
    fireball_growth: Float[Array, ""] | None = eqx.field(
        converter=as_optional_float_array, default=None
    )

    @property
    def charges(self) -> tuple[Charge, ...]:
        """All charges; rows of a log tell them apart by their `shot`."""
        return (self.charge, *self.others)

    def label(self, charge: Charge) -> str:
        """Return what follows a number's name to say of which charge; "" if of one."""
        return f".{charge.name}" if self.others else ""

    def clock_offsets(self) -> dict[str, Float[Array, "..."]]:
        """Return the offset of every clock by name: a sensor's own, or a recorder's."""
        own = {sensor.name: sensor.clock_offset_s for sensor in self.sensors}
        return own | {clock.name: clock.offset_s for clock in self.clocks}
