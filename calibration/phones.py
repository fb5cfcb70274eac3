"""Phones near blasts: picks beside what is known, and from how far they saturate.

    python -m calibration.phones            # writes calibration/results/phones_18kg.txt
    python -m calibration.phones saturation
        > calibration/results/phone_saturation.txt

Known are the charge, its place and time, and where the phones were, two of them 1.6 m
apart; not their clocks, nor their scale.

Saturation: a charge on the ground, a microphone on the ground, the laws that a record
has where nothing is said (shock kinematics), 48 kHz. The full scale is declared, not
measured: its peak over 20 uPa, at three levels that bracket what phones are taken to
bear. The range is where the record's largest sample comes to the full scale, found by
bisection of the record itself, and stands beside the range at which the law's peak is
as much. A high-pass of 20 Hz and a low-pass of 20 kHz, as phones have them, change the
peak, and with it the range: the last column.
"""

from datetime import UTC, datetime
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from calibration import run_part
from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.observations.records.stations import read_stations
from jblast.report.view import aligned
from jblast.scene import Charge, Instrument, Scene, Sensor
from jblast.sensors import recording, waves
from jblast.signals.picks.gathered import gathered

HERE = Path(__file__).parent
DATA = HERE / "data" / "inl_phones"
KEPT = HERE / "results" / "phones_18kg.txt"
CHARGE = (43.694175, -112.696747, 1500.0)
EXPLODED = datetime(2020, 8, 10, 21, 39, 32, tzinfo=UTC)
SOUND = 345.0
"""Of air at 23 degrees [m/s]; the shot was on an August afternoon on a desert plain."""
PUBLISHED = {
    "phone_1": (2031.045, "6.360"),
    "phone_2": (2031.561, "3.032"),
    "phone_3": (3835.221, "-"),
    "phone_4": (7740.063, "0.605"),
    "phone_5": (10074.971, "0.430"),
}
"""Range [m] and `internal_clock_offset_s` as the data set has them."""


MASSES_KG = (1.0, 15.0, 100.0)
LEVELS_DB = (120.0, 130.0, 140.0)
"""Full scale, peak over 20 uPa."""
REFERENCE_PA = 20e-6
RATE = 48_000.0
STEPS = 14
"""Of the bisection in ln of the range: its last step is 0.06 %."""
NEAREST_M, FARTHEST_M = 5.0, 50_000.0
BEFORE_S, LONG_S = 0.01, 0.08
PHONE = {"high_pass": 20.0, "low_pass": 20_000.0}


def table() -> str:
    """Return what was picked beside what is known."""
    found = gathered(sorted(DATA.glob("*.mseed")))
    stations = read_stations(DATA / "stations.csv")
    assert found.epoch is not None
    since = (EXPLODED - found.epoch).total_seconds()
    rows = []
    for one in found.picks:
        name = one.record.name
        published, offset = PUBLISHED[name]
        station = stations[name]
        assert station.frame is not None
        charge = station.frame.to_enu(*CHARGE)
        distance = float(np.linalg.norm(charge - np.array(station.position)))
        clock = one.pick.air_arrival_s - since
        rows.append(
            (
                name,
                f"{published:.1f}",
                f"{distance:.1f}",
                f"{clock:.3f}",
                f"{one.pick.sd('air_arrival_s'):.3f}",
                f"{distance / SOUND:.2f}",
                f"{clock - distance / SOUND:+.2f}",
                offset,
                ", ".join(one.notes),
            )
        )
    head = (
        *("phone", "published m", "range m", "arrived s", "sd s", "sound s"),
        *("clock s", "published s", "notes"),
    )
    return "\n".join(aligned([head, *rows]))


def main() -> None:
    """Print the table and keep it."""
    jax.config.update("jax_enable_x64", True)
    text = f"""18 kg at 2 to 10 km, five phones (SHAReD, INL_20200810_03)

arrived: by the phone's clock, since the published instant
sound:   the way at {SOUND:g} m/s
clock:   arrived less sound: what the clock is off by, if that is the speed of sound
published: internal_clock_offset_s of the data set.

{table()}

No pulse of a blast fits a phone two kilometres off: its microphone cuts what is slow,
and what comes behind the front is the land. The onset is told, and no more. Phones 1
and 2 stood 1.6 m apart; their clocks are 2.4 s apart.
"""
    print(text)
    write_text(KEPT, text)


def loudest(mass, distance, corners):
    """Return the largest sample of a record, and the law's peak [Pa]."""
    scene = Scene(Charge(mass_kg=mass))
    place = jnp.stack([distance, jnp.zeros(()), jnp.zeros(())])
    # without sound of the ground, and without absorption at these short ranges
    phone = Sensor("phone", place, "pressure", instrument=Instrument(RATE, **corners))
    pulse = waves(scene, place)[0].pulse
    key = jax.random.key(0)
    start = pulse.arrival_time - BEFORE_S
    samples = recording(scene, phone, key, start_s=start).samples(LONG_S)
    return jnp.max(samples), pulse.peak


def ranges(told, full_scale):
    """Return where the record's largest sample, and the law's peak, is the full scale.

    Args:
        told: `loudest` of many masses and distances.
        full_scale: Where the phone clips [Pa].
    """
    masses = jnp.asarray(MASSES_KG)
    found = []
    for of in (0, 1):
        near = np.full(masses.size, np.log(NEAREST_M))
        far = np.full(masses.size, np.log(FARTHEST_M))
        for _ in range(STEPS):
            middle = 0.5 * (near + far)
            over = np.asarray(told(masses, jnp.exp(middle))[of]) >= full_scale
            near, far = np.where(over, middle, near), np.where(over, far, middle)
        found.append(np.exp(0.5 * (near + far)))
    return found


def saturation() -> None:
    """Print the table."""
    start_jax()
    plain, phone = (
        jax.jit(jax.vmap(lambda mass, r, corners=corners: loudest(mass, r, corners)))
        for corners in ({}, PHONE)
    )
    rows = [["full scale", "peak", "charge", "by record", "by law", "20 Hz-20 kHz"]]
    rows.append(["dB", "Pa", "kg", "m", "m", "m"])
    for level in LEVELS_DB:
        full_scale = REFERENCE_PA * 10 ** (level / 20)
        by_record, by_law = ranges(plain, full_scale)
        filtered, _ = ranges(phone, full_scale)
        for i, mass in enumerate(MASSES_KG):
            numbers = (by_record[i], by_law[i], filtered[i])
            cells = [f"{number:.3g}" for number in (full_scale, mass, *numbers)]
            rows.append([f"{level:g}", *cells])
    print("a phone clips nearer than")
    print()
    print("\n".join(aligned(rows, right=range(6))))


if __name__ == "__main__":
    run_part({"18kg": main, "saturation": saturation})
