"""What the 200 g record says, as text: every number in it is computed."""

import textwrap

from calibration.gauge_200g import (
    BURSTS,
    LAWS,
    PULSES,
    UNITS,
    as_read,
    at_front,
    distance,
    end_slope,
    factor,
    fitted,
    lowest_height,
    nearest_explosive,
    noise,
    predicted,
    rise_time,
    table,
    tnt_mass,
)
from jblast.scene.charge import EXPLOSIVES
from jblast.waves.laws.kingery_bulmash import kingery_bulmash_shock_speed
from jblast.waves.laws.kinney_graham import kinney_graham_duration
from jblast.waves.scaling import scaled_distance

THIN_AIR = 85e3
"""What the air may have been [Pa]: some 1500 m up."""


def pulses_table() -> str:
    """Return the readings beside the law of both bursts."""
    pulses = {name: made() for name, made in PULSES.items()}
    columns = (*pulses, *(f"KB {burst}" for burst in BURSTS))
    lines = [f"  {'':14s}" + "".join(f"{name:>15s}" for name in columns)]
    for quantity, (unit, name) in UNITS.items():
        seen = [getattr(pulse, quantity) for pulse in pulses.values()]
        told = [predicted(quantity, burst) for burst in BURSTS]
        lines.append(
            f"  {f'{quantity} [{name}]':14s}"
            + "".join(f"{unit * value:15.3f}" for value in (*seen, *told))
        )
    decays = "".join(f"{pulse.decay:15.3f}" for pulse in pulses.values())
    lines.append(f"  {'decay b [-]':14s}{decays}")
    return "\n".join(lines)


def ratios_table() -> str:
    """Return observed over predicted, and the TNT factor that would make it one."""
    head = f"  {'':10s}" + "".join(f"{burst:>20s}" for burst in BURSTS for _ in (0, 1))
    lines = [
        head,
        f"  {'':10s}" + f"{'seen/KB':>20s}{'factor for 1':>20s}" * len(BURSTS),
    ]
    for quantity in LAWS:
        cells = ""
        for burst in BURSTS:
            told = predicted(quantity, burst)
            seen = [getattr(pulse(), quantity) for pulse in (as_read, at_front)]
            pairs = (
                [value / told for value in seen],
                [factor(quantity, burst, value) for value in seen],
            )
            for low, high in pairs:
                both = (
                    f"{low:.2f} {high:.2f}" if quantity != "arrival" else f"{low:.2f}"
                )
                cells += f"{both:>20s}"
        lines.append(f"  {quantity:10s}{cells}")
    return "\n".join(lines)


def explanation() -> str:
    """Return what explains the rest."""
    read, front, late = as_read(), at_front(), fitted()
    name, off = nearest_explosive("free-air")
    other, other_off = nearest_explosive("surface")
    told, mass = EXPLOSIVES[name], table()["charge_mass"]
    peak = predicted("peak", "free-air", told.pressure * mass)
    impulse = predicted("impulse", "free-air", told.impulse * mass)
    speed = float(kingery_bulmash_shock_speed(distance(), tnt_mass(), burst="free-air"))
    early = predicted("arrival", "free-air", told.pressure * mass) - read.arrival
    by_peak = factor("peak", "surface", read.peak) * mass
    early_ground = predicted("arrival", "surface", by_peak) - read.arrival
    long = predicted("duration", "free-air", told.impulse * mass)
    graham = float(kinney_graham_duration(distance(), told.impulse * mass))
    thin = {
        quantity: predicted(quantity, "free-air", ambient_pressure=THIN_AIR)
        / predicted(quantity, "free-air")
        - 1
        for quantity in ("peak", "impulse", "duration")
    }
    blur = noise() / end_slope()
    gap = late.arrival + late.duration - (read.arrival + read.duration)
    missed = end_slope() * gap**2 / 2
    echo = speed * read.duration
    paragraphs = (
        f"Burst and explosive: on the ground the charge would be worth "
        f"{factor('peak', 'surface', read.peak):.2f} of TNT by its peak and "
        f"{factor('impulse', 'surface', read.impulse):.2f} by its impulse; the nearest "
        f"explosive of the library, {other}, is {100 * other_off:.0f} % off (in ln). "
        f"In "
        f"free air {factor('peak', 'free-air', read.peak):.2f} and "
        f"{factor('impulse', 'free-air', read.impulse):.2f}: {name} has "
        f"{told.pressure:.2f} and {told.impulse:.2f}, {100 * off:.0f} % off. With "
        f"these "
        f"the reading over the law is {read.peak / peak:.2f} for the peak and "
        f"{read.impulse / impulse:.2f} for the impulse. That it was {name} and stood "
        f"free is inferred: no explosive and no height is told.",
        f"Gauge: {1e6 * rise_time():.0f} us from the first positive to the largest "
        f"sample are {1e3 * speed * rise_time():.0f} mm of the front's way, the size "
        f"of "
        f"a gauge. What it misses meanwhile is what the fit puts back at the front: "
        f"{100 * (front.peak / late.peak - 1):.0f} % over the author's peak, "
        f"{100 * (front.peak / read.peak - 1):.0f} % over the largest sample.",
        f"Duration: the law's {1e3 * long:.2f} ms ({name}, by impulse) are long, the "
        f"record ends after {100 * read.duration / long:.0f} to "
        f"{100 * front.duration / long:.0f} % of it; Kinney and Graham say "
        f"{1e3 * graham:.2f} ms, {'short' if graham < read.duration else 'long'}. The "
        f"end is where a pressure that falls slowly crosses zero: the record's rms "
        f"about its fit, {1e-3 * noise():.2f} kPa, is {1e3 * blur:.2f} ms there, and "
        f"the first negative sample comes {1e3 * gap:.2f} ms before the fit's zero. "
        f"What lies between is {100 * missed / read.impulse:.1f} % of the impulse.",
        f"Arrival: {1e3 * early:.2f} ms before the law of {name}, which no factor "
        f"explains: it would take {factor('arrival', 'free-air', read.arrival):.2f}. "
        f"Nor does the ground: there, at the factor of the peak, it is "
        f"{1e3 * early_ground:.2f} ms. A trigger so much after the detonation would; "
        f"its delay is not told.",
        f"Echo: the record keeps within {100 * noise() / late.peak:.1f} % of its peak "
        f"(rms) of one smooth pulse, so the ground's echo came after its "
        f"{1e3 * read.duration:.2f} ms. At the speed of the front, {speed:.0f} m/s, "
        f"charge and gauge then stood {lowest_height(echo):.1f} m up or higher, if "
        f"equally "
        f"high. Air: not told; at {1e-3 * THIN_AIR:.0f} kPa the law moves by "
        f"{100 * thin['peak']:+.0f} % (peak), {100 * thin['impulse']:+.0f} % (impulse) "
        f"and {100 * thin['duration']:+.0f} % (duration).",
    )
    return "\n".join(textwrap.fill(text, 88) for text in paragraphs)


def text_200g() -> str:
    """Return everything that is printed of the 200 g record."""
    z = float(scaled_distance(distance(), tnt_mass()))
    title = (
        f"{1e3 * table()['charge_mass']:.0f} g at {distance():.0f} m, TNT factor "
        f"{table()['tnt_factor_used_by_author']:.1f} by its author: Z = {z:.2f}; "
        "arrival from the trigger.\nSimpson's impulse; samples were not published"
    )
    ratios = "seen over law at that mass, as read and at the front; then the TNT factor"
    return "\n".join((title, pulses_table(), ratios, ratios_table(), "", explanation()))
