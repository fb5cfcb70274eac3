"""Blasts in recorded sound, film and pressure records.

The matched filter and its threshold, arrays of microphones, detection of flashes
(`flash`) and picks of pressure records (`picks`).

Sound is filtered by NumPy in float64, not by JAX: no gradient is needed here, a
transform of a block takes three quarters of the time, and nothing is compiled
(`calibration/detector_limits.py`).
"""

from jblast.signals.arrays import (
    Direction as Direction,
    PairDelay as PairDelay,
    RelativeTimes as RelativeTimes,
    direction as direction,
    pair_delay as pair_delay,
    relative_times as relative_times,
)
from jblast.signals.detect_files import (
    FilmDetections as FilmDetections,
    SoundDetections as SoundDetections,
    detect as detect,
)
from jblast.signals.matched_filter import (
    Detection as Detection,
    Filtered as Filtered,
    MatchedKernel as MatchedKernel,
    OverlapSave as OverlapSave,
    PeakPicker as PeakPicker,
    Stream as Stream,
    detections as detections,
    false_alarms_at as false_alarms_at,
    filtered_by as filtered_by,
    matched_filter as matched_filter,
    matched_kernel as matched_kernel,
    stream as stream,
    threshold_for as threshold_for,
)
from jblast.signals.noise import (
    NoiseSpectrum as NoiseSpectrum,
    noise_spectrum as noise_spectrum,
    white_noise as white_noise,
)
from jblast.signals.templates import (
    blast_template as blast_template,
    recorded_template as recorded_template,
)
