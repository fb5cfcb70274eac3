"""Five phones that recorded 18 kg at 2 to 10 km: picks beside what is known.

    python -m calibration.phones_18kg

Known are the charge, its place and time, and where the phones were, two of them 1.6 m
apart; not their clocks, nor their scale.
"""

from datetime import UTC, datetime
from pathlib import Path

import jax
import numpy as np

from jblast.files import write_text
from jblast.observations.records.stations import read_stations
from jblast.report.words import aligned
from jblast.signals.picks.pick_log import gathered

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
        clock = float(one.pick.air_arrival_s) - since
        rows.append(
            (
                name,
                f"{published:.1f}",
                f"{distance:.1f}",
                f"{clock:.3f}",
                f"{float(one.pick.spread[0]):.3f}",
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


if __name__ == "__main__":
    main()
