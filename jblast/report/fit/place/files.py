"""The map as files that other programs read: GeoJSON and KML."""

from pathlib import Path

from jblast.files import write_text
from jblast.inference.fitting.result import Fit
from jblast.report.fit.place.features import features
from jblast.report.fit.place.geojson import geojson
from jblast.report.fit.place.ground_map import ground_map
from jblast.report.fit.place.kml import kml
from jblast.report.fit.reference_values import Accepted
from jblast.report.fit.rows import log_name

PLACE_FILES = ("place.geojson", "place.kml")


def write_place(
    fit: Fit, directory: Path, accepted: Accepted | None = None
) -> list[Path]:
    """Write the map in degrees, where the log or its scene says where on the Earth.

    Args:
        fit: The fit.
        directory: Where to; it is there.
        accepted: Published values by parameter name, each with where it comes from.

    Returns:
        The files written; none without a frame, or without a sensor's place.
    """
    frame = fit.observations.frame
    shown = None if frame is None else ground_map(fit, accepted)
    if frame is None or shown is None:
        return []
    found = features(shown, frame, fit)
    name = log_name(fit)
    title = f"Blast fit: {name}" if name else "Blast fit"
    paths = [directory / name for name in PLACE_FILES]
    for path, text in zip(paths, (geojson(found), kml(found, title)), strict=True):
        write_text(path, text)
    return paths
