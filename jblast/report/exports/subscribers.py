"""Requested views and recordings of a run."""

from pathlib import Path

import numpy as np

from jblast.errors import InputError, argument, needed
from jblast.files import refuse_existing
from jblast.study.running import Paced, Run, Subscriber


def check_watchers(
    *,
    save: str | None = None,
    mcap: str | None = None,
    serves: bool = False,
    force: bool = False,
) -> None:
    """Check before a run what can be refused.

    Args:
        save: Recording for Rerun.
        mcap: Bag of ROS 2.
        serves: Whether the run is shown in a browser.
        force: Whether existing files may be overwritten.

    Raises:
        InputError: A file exists or has another suffix, or an extra is not installed.
    """
    for name, file, suffix in (("save", save, ".rrd"), ("mcap", mcap, ".mcap")):
        if file and Path(file).suffix != suffix:
            raise InputError(
                f"{argument(name)}: expected a name in {suffix}, got {file}"
            )
        if file:
            refuse_existing(file, force=force)
    # extras are imported here: a missing one would otherwise be found after the flight
    if serves or save:
        needed("rerun", "viewer", save or "viewer", "a run is shown")
    if mcap:
        needed("mcap_ros2", "ros", mcap, "a ROS 2 bag is written")


def watchers(
    run: Run,
    *,
    save: str | None = None,
    mcap: str | None = None,
    serves: bool = False,
    speed: float | None = None,
) -> list[Subscriber]:
    """Return the subscribers of a run; arguments as of `check_watchers`.

    Args:
        run: The run.
        save: Recording for Rerun.
        mcap: Bag of ROS 2.
        serves: Whether the run is shown in a browser.
        speed: Speed of the run over that of real time; None: as fast as it is computed.
    """
    found: list[Subscriber] = []
    scene = run.world.scene
    if mcap:
        from jblast.report.exports.ros_bag import RosBag

        found.append(
            RosBag(
                path=Path(mcap),
                scene=scene,
                seconds=run.seconds,
                place=run.place,
                peaks_pa=_peaks(run),
            )
        )
    if serves or save:
        from jblast.report.exports.rerun import Viewer
        from jblast.waves.propagation import sound_speed_of

        found.append(
            Viewer(
                scene=scene,
                sound_speed_m_s=float(sound_speed_of(scene.air)),
                recording_id=f"{Path(run.world.source).stem}-{run.world.seed}",
                save=Path(save) if save else None,
                live=serves,
            )
        )
    return [*found, Paced(speed)] if speed is not None else found


def _peaks(run: Run) -> dict[str, float]:
    """Return the sum of the peaks of all blasts at each sampling sensor [Pa]."""
    if run.listening is None:
        return {}
    peaks = np.nansum(run.listening.truth.values["peak_overpressure_pa"], axis=1)
    return dict(
        zip((s.name for s in run.listening.sensors), peaks.tolist(), strict=True)
    )
