"""Ten records to try `jblast pick` and `jblast fit RECORDS/` on.

    python -m calibration.records_example

writes `calibration/data/records_example`: what ten pressure gauges about 15 kg of TNT
would record, 50 to 250 m away, by the laws that `jblast listen` takes for the scene
`calibration/data/records_example_truth.toml`, with white noise (seed 20). Each is kept
as a triggered recorder keeps it: from 25 ms before the front to 90 ms after it, on the
clock that all of them share. All is simulated, and says so. `STATIONS_degrees.csv` has
the same places as latitudes and longitudes: the scene's origin is put at `ORIGIN`.
"""

from pathlib import Path

import numpy as np

from jblast.cli.jax_start import start_jax
from jblast.files import table_text, write_text
from jblast.observations.places import Frame
from jblast.scene import Instrument, read_scene
from jblast.sensors.listening import Listening, packets, plan
from jblast.sensors.record_writer import CLOCK, record_comments

DATA = Path(__file__).parent / "data"
TRUTH, FOLDER = DATA / "records_example_truth.toml", DATA / "records_example"
SEED = 20
ORIGIN = Frame(52.0, 5.0, 10.0)
"""Where on the Earth the scene is put: flat land, a little above the sea."""
BEFORE_S, AFTER_S = 0.025, 0.09
HEAD = "# SIMULATED, not measured: where the gauges of records_example stood\n"


def record_csv(listening: Listening, number: int) -> str:
    """Return one gauge's record about its front, as CSV with its provenance."""
    sensor = listening.sensors[number]
    (samples,) = packets(listening, sensor)
    rate_hz = (sensor.instrument or Instrument()).rate
    arrival = float(listening.truth.values["air_arrival_s"][number, 0])
    first = int((arrival - BEFORE_S) * rate_hz)
    stretch = samples[first : first + round((BEFORE_S + AFTER_S) * rate_hz), 0]
    times = (first + np.arange(stretch.size)) / rate_hz
    rows = [
        [f"{t:.5f}", f"{p:.1f}"]
        for t, p in zip(times.tolist(), stretch.tolist(), strict=True)
    ]
    comments = [
        *(
            line
            for line in record_comments(listening, TRUTH.name, SEED)
            if line != CLOCK
        ),
        "cut from 25 ms before the front to 90 ms after it; one clock for all gauges",
    ]
    return table_text([["time_s", "overpressure_pa"], *rows], comments)


def stations_csv(listening: Listening) -> str:
    """Return where the gauges stood, in metres."""
    rows = [
        [sensor.name, *(f"{x:g}" for x in np.asarray(sensor.position_m).tolist())]
        for sensor in listening.sensors
    ]
    return HEAD + table_text([["sensor", "east_m", "north_m", "up_m"], *rows])


def stations_degrees_csv(listening: Listening) -> str:
    """Return where the gauges stood, in degrees: eight digits are a millimetre."""
    positions = np.array([sensor.position_m for sensor in listening.sensors])
    places = ORIGIN.to_geodetic(positions).tolist()
    rows = [
        [sensor.name, f"{lat:.8f}", f"{lon:.8f}", f"{alt:.3f}"]
        for sensor, (lat, lon, alt) in zip(listening.sensors, places, strict=True)
    ]
    return HEAD + table_text([["sensor", "lat_deg", "lon_deg", "alt_m"], *rows])


def main() -> None:
    """Write the folder."""
    start_jax(quick=True)
    listening = plan(read_scene(TRUTH), SEED, None)
    FOLDER.mkdir(exist_ok=True)
    for number, sensor in enumerate(listening.sensors):
        write_text(FOLDER / f"{sensor.name}.csv", record_csv(listening, number))
    write_text(FOLDER / "STATIONS.csv", stations_csv(listening))
    write_text(FOLDER / "STATIONS_degrees.csv", stations_degrees_csv(listening))


if __name__ == "__main__":
    main()
