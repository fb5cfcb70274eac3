"""The mark of worlds in which blasts act other than they do."""

from jblast.world import Preset

MARK = "as the thesis computes it, not as blasts are"


def preset_words(preset: Preset) -> str:
    """Return the mark of a run by a preset: on all that it prints and writes."""
    return f"preset {preset.name}: {MARK}"


def preset_notes(preset: Preset) -> list[str]:
    """Return what somebody should know who uses such a run."""
    notes = [
        f"{preset_words(preset)} ({preset.source}); the scene's own laws, by which "
        "jblast fit goes, are others"
    ]
    if preset.pressure_speed_m_s is not None:
        notes.append(
            f"pressure and force travel at {preset.pressure_speed_m_s:g} m/s, the "
            "sound by eq. 3.4: one blast comes at two times, as it does there"
        )
    return notes
