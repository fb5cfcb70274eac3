"""What is said of a pick: its notes and why something stands in no row, in words."""

from jblast.inference.picks import NoteKind, RecordPick
from jblast.inference.records import Reason
from jblast.report.numbers import printed_number
from jblast.report.words import joined

NOTES: dict[NoteKind, str] = {
    "nothing_found": "nothing found",
    "onset_alone": "no blast pulse fits the samples: when they became loud is told",
    "not_converged": "the fit of the pulse did not converge",
    "clipped": "clipped at {clipped_at}",
    "misfit": "the samples are not of a blast pulse's form (misfit {misfit}, where "
    "chance gives 1)",
    "few_quiet_samples": "too few quiet samples before the front to know the noise by",
    "under_sampled": "fewer than eight samples make the positive phase",
    "sharp_front": "the front rises within a sample",
    "cut_short": "the record ends before the positive phase does",
    "drifting": "the baseline drifts",
    "curved_baseline": "the baseline bends: duration and impulse rest on its form",
    "resonating": "the sensor rings at {rings}",
    "high_passed": "what follows the pulse looks high-passed, and no corner was given; "
    "a Friedlander pulse that runs on below zero looks the same",
    "later_arrival": "further fronts at {later}",
    "zero_shift": "the zero of the gauge shifts at the front: duration and impulse "
    "depend on when it does",
    "reversed_polarity": "the polarity is reversed: picked upside down",
    "front_alone": "what follows the front is not of a blast pulse's form: arrival and "
    "peak are those of the front alone",
    "duration_unsure": "the duration is hardly told",
    "faint": "the pulse is faint",
}
"""Of what a pick's notes say."""
REASONS: dict[Reason, str] = {
    "poor": "a poor pick",
    "onset_alone": "no pulse fits the samples",
    "uncalibrated": "nobody said how many pascals a sample stands for",
    "high_passed": "a high-pass of unknown corner changes them",
    "curved_baseline": "the baseline bends, and they rest on its form",
    "cut_short": "the record ends too early",
    "zero_shift": "the zero of the gauge shifts at the front",
    "front_alone": "what follows the front is no blast pulse",
    "weaker": "weaker than another of the same bang there: an echo, perhaps",
}
"""Why something stands in no row of the log."""
RECORDS_ALT = "Records with their fitted pulses, and residuals."
RECORDS_CAPTION = (
    "Grey: samples, their range where several fall on one point. Blue: fitted pulse. "
    "Red: its arrival and, dotted, the end of its positive phase; orange: further "
    "fronts; dashed: where the record clips. Below each: samples less pulse, means of "
    "what falls on one point. A recorder's high-pass is drawn where its corner was "
    "given, what rings or comes later is not."
)


def note_words(one: RecordPick) -> list[str]:
    """Return what is to be said of a pick."""
    later = [float(time) for time in one.pick.later_arrivals_s if time == time]
    scale = float(one.pick.clipped_at_pa)
    level = f"{scale:.3g} of full scale"
    if one.record.calibrated and scale == scale:
        level = printed_number("clipped_at_pa", scale, 3)
    values = {
        "clipped_at": level,
        "rings": f"{float(one.pick.resonance_hz):.3g} Hz",
        "misfit": f"{float(one.pick.misfit):.3g}",
        "later": f"{joined([f'{time:.6g}' for time in later])} s",
    }
    return [NOTES[kind].format(**values) for kind in one.notes]
