"""Events of a file, whatever its format; its suffix says which."""

from pathlib import Path

from jblast.errors import InputError
from jblast.sensors.camera.files.events.aedat4.read import read_aedat4
from jblast.sensors.camera.files.events.arrays import read_arrays
from jblast.sensors.camera.files.events.dsec import read_dsec
from jblast.sensors.camera.files.events.evt3.read import read_evt3
from jblast.sensors.camera.files.events.recorded import RecordedEvents
from jblast.sensors.camera.files.events.write import check_suffix

READERS = {
    ".h5": read_dsec,
    ".hdf5": read_dsec,
    ".npz": read_arrays,
    ".raw": read_evt3,
    ".aedat4": read_aedat4,
}


def read_events(
    path: str | Path, *, size: tuple[int, int] | None = None
) -> RecordedEvents:
    """Read a file of events whole.

    Args:
        path: Its suffix is one that `write_events` writes.
        size: Width and height of a file that does not tell them.

    Raises:
        InputError: There is no such file, its suffix is another one, what reads its
            format is not installed, it is empty or not whole, tells no size, or holds
            what cannot be: times that fall, places outside the image.
    """
    path = Path(path)
    suffix = check_suffix(path)
    if not path.is_file():
        what = "is a directory" if path.is_dir() else "no such file"
        raise InputError(f"{path}: {what}; expected a file of events")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; expected a file of events")
    return READERS[suffix](path, size)
