r"""Scaled distance, Sachs' factors, and laws that are one curve times a factor.

Hopkinson (1915) and Cranz (1926): at a given ambient air, distance, time and impulse
grow as $W^{1/3}$ while pressure stays. Sachs (1944, BRL Report 466): in other air the
overpressure over the ambient pressure $P_0$ depends on $R (P_0/W)^{1/3}$ alone. The
curves are those of 1 kg at 101325 Pa and 340.29 m/s. A law evaluates its curve at
$Z = R/S_d$ and multiplies by the factor of its quantity (`FACTORS`). Temperature enters
only through the sound speed.

Half of a nuclear yield goes into air blast, the rest into heat and radiation, so a
charge of mass W blasts like a nuclear yield of 2 W: 1 kt of TNT like 2 kt. The factor
is MultiPEM's C2N = 2. A law for a yield is therefore evaluated at Y = 2 W, and at a
distance in metres per kt^(1/3).
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from jblast.constants import STANDARD_PRESSURE, STANDARD_SOUND_SPEED
from jblast.quantities import unit_suffix
from jblast.registry import Law, declared_scatter, register
from jblast.types import namespace
from jblast.waves.arguments import Number, checked
from jblast.waves.tables import Curve, Numbers

NUCLEAR_YIELD_PER_MASS = 2.0
"""Nuclear yield with the air blast of a TNT charge, over its mass [-]."""

NUCLEAR_SCALED_METRES = (1e6 / NUCLEAR_YIELD_PER_MASS) ** (1.0 / 3.0)
"""Scaled distance in m/kt^(1/3) that is 1 m/kg^(1/3): 79.37 [kg^(1/3)/kt^(1/3)]."""

LOG_NUCLEAR_SCALED_METRES = math.log(NUCLEAR_SCALED_METRES)

Span = tuple[float, float]
"""First and last valid scaled distance [m/kg^(1/3)]."""
SD = (0.10, 0.10)
"""Declared scatter of a shot and a record, where the source states none [ln]."""
NOWHERE: Span = (math.inf, -math.inf)


def log_sachs_length(charge_mass: Number, ambient_pressure: Number) -> Numbers:
    r"""Return $\ln S_d = \tfrac13 \ln(W/S_p)$, the logarithm of Sachs' length."""
    xp = namespace(charge_mass, ambient_pressure)
    # Neither cbrt, which XLA does not vectorise on a CPU, nor a power.
    return xp.log(charge_mass / (ambient_pressure / STANDARD_PRESSURE)) / 3.0


def log_scaled_distance(
    slant_range: Number, charge_mass: Number, ambient_pressure: Number
) -> Numbers:
    r"""Return $\ln Z = \ln R - \ln S_d$, the argument of the curves."""
    log_length = log_sachs_length(charge_mass, ambient_pressure)
    return namespace(slant_range, log_length).log(slant_range) - log_length


def scaled_distance(
    slant_range: Number,
    charge_mass: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
) -> Numbers:
    r"""Return the scaled distance $Z = R/S_d$ [m/kg^(1/3)].

    At standard pressure it is Hopkinson's and Cranz's $Z = R/W^{1/3}$.

    Args:
        slant_range: Range $R$ [m], positive.
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
    """
    return slant_range / sachs_distance_factor(charge_mass, ambient_pressure)


@checked
def sachs_distance_factor(
    charge_mass: Number, ambient_pressure: Number = STANDARD_PRESSURE
) -> Numbers:
    r"""Return $S_d = (W/S_p)^{1/3}$, by which distances multiply [kg^(1/3)].

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive; $S_p = P_0/101325$ Pa.
    """
    log_length = log_sachs_length(charge_mass, ambient_pressure)
    return namespace(log_length).exp(log_length)


@checked
def sachs_time_factor(
    charge_mass: Number,
    ambient_pressure: Number = STANDARD_PRESSURE,
    sound_speed: Number = STANDARD_SOUND_SPEED,
) -> Numbers:
    r"""Return $S_t = S_d \cdot 340.29/c_0$, by which times multiply [kg^(1/3)].

    In dry air it is the usual $S_d (288.15/T)^{1/2}$.

    Args:
        charge_mass: TNT-equivalent mass $W$ [kg], positive.
        ambient_pressure: $P_0$ [Pa], positive.
        sound_speed: $c_0$ [m/s], positive.
    """
    factor = sachs_distance_factor(charge_mass, ambient_pressure)
    return factor * (STANDARD_SOUND_SPEED / sound_speed)


FACTORS: dict[str, tuple[bool, Callable[[Any, Any, Any], Any]]] = {
    "_pa": (False, lambda r, p, c: p / STANDARD_PRESSURE),
    "_pa_s": (True, lambda r, p, c: p / STANDARD_PRESSURE * _slowness(c)),
    "_s": (True, lambda r, p, c: _slowness(c)),
    "_m_s": (False, lambda r, p, c: c / STANDARD_SOUND_SPEED),
    "_m": (True, lambda r, p, c: 1.0),
    "travel": (False, lambda r, p, c: r / c),
}
"""Factor of a curve by the unit of its quantity: whether Sachs' length $S_d$ multiplies
it, and the rest by slant range, ambient pressure and sound speed.

A curve with the factor "travel" is $c_0 t/R$: the share of the travel time of sound.
"""


def _slowness(sound_speed: Any) -> Any:
    return STANDARD_SOUND_SPEED / sound_speed


def scaled_value(
    factor: str,
    log_value: Numbers,
    log_length: Numbers,
    slant_range: Number,
    ambient_pressure: Number,
    sound_speed: Number,
) -> Numbers:
    r"""Return a value times its factor, in SI.

    Args:
        factor: Key of `FACTORS`.
        log_value: ln of the value of the curve.
        log_length: $\ln S_d$.
        slant_range: Range $R$ [m].
        ambient_pressure: $P_0$ [Pa].
        sound_speed: $c_0$ [m/s].
    """
    lengthens, rest = FACTORS[factor]
    # in the exponent: a second exponential would cost as much as the polynomial
    log_value = log_value + log_length if lengthens else log_value
    value = namespace(log_value).exp(log_value)
    return rest(slant_range, ambient_pressure, sound_speed) * value


def scaled_law(
    quantity: str,
    curves: Curve | Mapping[str, Curve],
    spans: Mapping[str, Span] | None = None,
    *,
    name: str,
    source: str,
    factor: str = "",
    title: str = "",
    note: str = "",
    words: str = "",
    sd: tuple[float, float] | None = None,
    far_scatter: Callable[..., tuple[Any, Any]] | None = None,
) -> Callable[..., Any]:
    """Register a law that is a curve of Z times a factor, and return its function.

    Args:
        quantity: Predicted quantity.
        curves: One curve, or one for "surface" and one for "free-air".
        spans: Range of validity for each burst with a validity; that of its curve if
            None.
        name: Name of the law.
        source: Reference.
        factor: Key of `FACTORS`; "" for the unit of the quantity.
        title: Name in sentences.
        note: Addition to the range in words.
        words: Range in words; "" for that of `spans`.
        sd: Declared scatter in ln: of a shot and of a record. None: 1 % each for
            arrival and shock speed, 10 % each for other quantities.
        far_scatter: As in `registry.Law`.
    """
    if spans is None:
        assert not isinstance(curves, Curve)
        spans = {burst: (curve.z_min, curve.z_max) for burst, curve in curves.items()}
    if sd is None:
        sd = (0.01, 0.01) if quantity in ("air_arrival_s", "shock_speed_m_s") else SD
    factor = factor or unit_suffix(quantity)

    def law(
        slant_range: Number,
        charge_mass: Number,
        ambient_pressure: Number = STANDARD_PRESSURE,
        sound_speed: Number = STANDARD_SOUND_SPEED,
        burst: str = "surface",
    ) -> Numbers:
        log_length = log_sachs_length(charge_mass, ambient_pressure)
        xp = namespace(slant_range, log_length)
        log_z = xp.log(slant_range) - log_length
        log_value = (curves if isinstance(curves, Curve) else curves[burst])(log_z)
        others = slant_range, ambient_pressure, sound_speed
        return scaled_value(factor, log_value, log_length, *others)

    absent = ["sound_speed"] * (factor == "_pa") + ["burst"] * isinstance(curves, Curve)
    function = checked(law, absent)
    function.__name__ = function.__qualname__ = f"{name}_{quantity}"
    register(
        Law(
            quantity=quantity,
            name=name,
            title=title,
            function=function,
            range=(words or span_words(spans)) + note,
            source=source,
            valid=valid_within(spans),
            scatter=declared_scatter(*sd),
            scatter_source="declared",
            far_scatter=far_scatter,
        )
    )
    return function


def valid_within(spans: Mapping[str, Span]) -> Callable[..., Any]:
    """Return the validity function of a span of Z for each burst."""

    def valid(
        slant_range: Number,
        charge_mass: Number,
        ambient_pressure: Number = STANDARD_PRESSURE,
        burst: str = "surface",
    ) -> Any:
        first, last = spans.get(burst, NOWHERE)
        z = scaled_distance(slant_range, charge_mass, ambient_pressure)
        return (z >= first) & (z <= last)

    return valid


def span_words(spans: Mapping[str, Span]) -> str:
    """Return spans in words: "Z = 0.0674 (free-air 0.0531) to 40 m/kg^(1/3)"."""
    (burst, (first, last)), *others = spans.items()
    alone = "" if others else f"{burst.replace('-', ' ')}, "
    other = "".join(f" (free-air {_short(z)})" for _, (z, _) in others if z != first)
    return f"{alone}Z = {_short(first)}{other} to {_short(last)} m/kg^(1/3)"


def _short(z: float) -> str:
    return f"{z:.3g}".replace("e+0", "e")
