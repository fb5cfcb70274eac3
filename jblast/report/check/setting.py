"""What a log is counted from, and what a fit would leave free, in words."""

from datetime import UTC

from jblast.observations import Observations
from jblast.observations.default_scene import for_log
from jblast.report.words import joined, parameter_words
from jblast.scene import UncertainScene
from jblast.scene.uncertain import NO_SCENE

NAMED = 8
"""Numbers that are named one by one."""


def setting_lines(log: Observations, uncertain: UncertainScene) -> list[str]:
    """Return a sentence each on datum, clock and what is not known.

    Args:
        log: As it was read.
        uncertain: The scene it is checked beside.
    """
    lines = []
    if log.frame is not None:
        from jblast.report.fit.place.map_words import degrees  # with all of a report

        frame = log.frame
        middle = uncertain.place is None
        whose = "the middle of the sensors" if middle else "as the scene says"
        lines.append(
            "places are degrees of WGS84; east, north and up count from "
            f"{degrees(frame.lat_deg, frame.lon_deg)}, {frame.alt_m:.6g} m, {whose}"
        )
    if log.epoch is not None:
        start = log.epoch.astimezone(UTC)
        lines.append(f"times count from {start:%Y-%m-%d %H:%M:%S} UTC")
    if not len(log) or len(set(log.shot)) > 1:
        return lines
    free = [parameter_words(name) for name in for_log(uncertain, log).beliefs]
    if uncertain.source == NO_SCENE and len(free) > 1:
        more = [f"{len(free) - NAMED} more"] if len(free) > NAMED else []
        lines.append(f"without a scene a fit leaves free {joined(free[:NAMED] + more)}")
    return lines
