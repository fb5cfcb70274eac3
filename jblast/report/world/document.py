"""What `jblast world --json` prints and run.json holds."""

from typing import Any

from jblast.json_values import plain
from jblast.report.world.preset import MARK, preset_notes
from jblast.report.world.run import WorldRun
from jblast.report.world.tables import blast_numbers


def world_document(run: WorldRun) -> dict[str, Any]:
    """Return a world as JSON can hold it; what nobody has is null."""
    made, preset = run.made, run.world.preset
    blasts = []
    for charge in run.world.charges:
        time, *place, mass = blast_numbers(charge)
        blasts.append(
            {"shot": charge.name, "time_s": time, "position_m": place, "mass_kg": mass}
        )
    return {"schema": 1} | plain(
        {
            "scene": run.world.source,
            "seed": run.world.seed,
            "seconds": run.seconds,
            "command": made.command,
            "date": made.date,
            "versions": made.versions,
            "scene_sha256": None if made.scene is None else made.scene.sha256,
            "preset": None
            if preset is None
            else {"name": preset.name, "mark": MARK, "source": preset.source},
            "laws": dict(run.world.scene.law),
            "blasts": blasts,
            "perceived": [one._asdict() for one in run.perceived],
            "not_perceived": run.late,
            "readings": 0 if run.readings is None else len(run.readings),
            "flight": run.flight,
            "sound": run.sound,
            "imu": run.imu,
            "camera": run.film,
            "warnings": warnings_of(run),
        }
    )


def warnings_of(run: WorldRun) -> list[str]:
    """Return what somebody should know who uses the run."""
    said = [] if run.world.preset is None else preset_notes(run.world.preset)
    said += run.warnings
    if not run.world.shots:
        said.append("no blast was drawn: nobody perceives one, and nothing flew")
    if run.late:
        said.append(
            f"{run.late} times a blast comes to somebody after the end, at "
            f"{run.seconds:g} s: it is not among what was perceived"
        )
    if run.late_readings:
        said.append(
            f"{run.late_readings} waves come to sensors after the end: no reading "
            "of them was written"
        )
    if run.readings is None and run.world.shots:
        said.append("no sensor says what it records, so there is no observations.csv")
    return said
