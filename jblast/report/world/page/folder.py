"""What the folder of a world holds, read back for its page."""

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from jblast.errors import InputError
from jblast.report.listen.sensor_record import COLUMNS

COLUMNS_DRAWN = 2000
"""Of a waveform: of each column its least and greatest sample are kept."""
KEY = "perceived"
UNITS = {"_m_s": "m/s", "_pa": "Pa"}
"""Of what sensors sample, by how the name of the column ends."""


@dataclass(frozen=True)
class Waveform:
    """What one sensor sampled, as far as a picture shows it.

    Attributes:
        sensor: Its name.
        column: What was sampled, with the unit.
        time_s: Middle of each column.
        least: Smallest sample of each.
        greatest: Largest sample of each.
    """

    sensor: str
    column: str
    time_s: Float[np.ndarray, " column"]
    least: Float[np.ndarray, " column"]
    greatest: Float[np.ndarray, " column"]

    @property
    def title(self) -> str:
        """Whose it is, and what."""
        return f"{self.sensor}: {self._parts[0].replace('_', ' ')}"

    @property
    def unit(self) -> str:
        """In brackets."""
        return f"[{self._parts[1]}]"

    @property
    def _parts(self) -> tuple[str, str]:
        for suffix, unit in UNITS.items():
            if self.column.endswith(suffix):
                return self.column.removesuffix(suffix), unit
        return self.column, "-"


@dataclass(frozen=True)
class RunFolder:
    """A world's folder.

    Attributes:
        path: Where it is.
        document: What run.json says.
        flight: Rows of flight.csv; None where nothing flew.
        waveforms: By sensor that samples.
        frames: Time of each frame that was kept [s] and its file.
        events_s: When each event was [s]; none where there is no camera.
    """

    path: Path
    document: dict[str, Any]
    flight: pd.DataFrame | None
    waveforms: tuple[Waveform, ...]
    frames: tuple[tuple[float, Path], ...]
    events_s: Float[np.ndarray, " event"]


def read_run(path: str | Path) -> RunFolder:
    """Read a folder that `jblast world` wrote.

    Raises:
        InputError: It is none, or something that it names is missing or broken.
    """
    path = Path(path)
    document = _document(path / "run.json")
    flight = None
    if document["flight"] is not None:
        flight = _table(path / "flight.csv")
    return RunFolder(
        path,
        document,
        flight,
        _waveforms(path / "sound", document["sound"]),
        *_film(path / "camera", document["camera"]),
    )


def _document(file: Path) -> dict[str, Any]:
    if not file.exists():
        raise InputError(
            f"{file}: no such file; expected a folder that `jblast world --out` wrote"
        )
    try:
        document = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{file}: expected the answer of a world ({error}); expected a folder that "
            "`jblast world --out` wrote"
        ) from None
    if not isinstance(document, dict) or KEY not in document:
        raise InputError(f"{file}: expected the answer of a world, got another")
    return document


def _table(file: Path) -> pd.DataFrame:
    """Return a table of CSV below its lines of comment."""
    try:
        with file.open(encoding="utf-8") as lines:
            comments = next(n for n, line in enumerate(lines) if line[:1] != "#")
        return pd.read_csv(file, skiprows=comments)
    except (OSError, ValueError, StopIteration) as error:
        raise InputError(f"{file}: expected a table ({error})") from None


def _waveforms(directory: Path, sound: dict[str, Any] | None) -> tuple[Waveform, ...]:
    sensors = sound["sensors"] if sound else {}
    return tuple(_waveform(directory, name, of) for name, of in sensors.items())


def _waveform(directory: Path, name: str, entry: dict[str, Any]) -> Waveform:
    file, names = directory / entry["file"], COLUMNS[entry["kind"]]
    if entry["kind"] == "microphone":
        import soundfile

        try:
            samples, rate = soundfile.read(file, dtype="float32")
        except (OSError, soundfile.LibsndfileError) as error:
            raise InputError(f"{file}: expected sound ({error})") from None
        time, samples = np.arange(len(samples)) / rate, samples * entry["full_scale_pa"]
    else:
        table = _table(file)
        time, samples = table["time_s"].to_numpy(), table[list(names)].to_numpy()
        part = int(np.argmax(np.ptp(samples, axis=0))) if len(samples) else 0
        samples, names = samples[:, part], (names[part],)
    edges = np.unique(np.linspace(0, len(samples), COLUMNS_DRAWN + 1).astype(int)[:-1])
    if not len(samples):
        return Waveform(name, names[0], *np.zeros((3, 0)))
    least = np.minimum.reduceat(samples, edges)
    return Waveform(
        name, names[0], time[edges], least, np.maximum.reduceat(samples, edges)
    )


def _film(
    directory: Path, camera: dict[str, Any] | None
) -> tuple[tuple[tuple[float, Path], ...], Float[np.ndarray, " event"]]:
    if camera is None:
        return (), np.zeros(0)
    from jblast.sensors.camera.files.events.read import read_events

    with (directory / "frames.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    frames = [(float(r["time_s"]), directory / "frames" / r["file"]) for r in rows]
    events = read_events(directory / "events.h5")
    return tuple(frames), (events.t + events.t_offset) * 1e-6
