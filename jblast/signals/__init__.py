"""Blasts in recorded sound, film and pressure records.

The matched filter and its threshold, arrays of microphones, detection of flashes
(`flash`) and picks of pressure records (`picks`).

Sound is filtered by NumPy in float64, not by JAX: no gradient is needed here, a
transform of a block takes three quarters of the time, and nothing is compiled
(`calibration/results/detector_limits.txt`).
"""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.signals.arrays import (
        Direction as Direction,
        RelativeTimes as RelativeTimes,
        direction as direction,
        relative_times as relative_times,
    )
    from jblast.signals.detect_files import (
        FilmDetections as FilmDetections,
        SoundDetections as SoundDetections,
        detect as detect,
    )
    from jblast.signals.detection import Detection as Detection
    from jblast.signals.matched_filter import (
        MatchedKernel as MatchedKernel,
        false_alarms_at as false_alarms_at,
        filtered as filtered,
        matched_kernel as matched_kernel,
        threshold_for as threshold_for,
    )
    from jblast.signals.noise import (
        NoiseSpectrum as NoiseSpectrum,
        noise_spectrum as noise_spectrum,
        white_noise as white_noise,
    )
    from jblast.signals.sound_watch import (
        Channel as Channel,
        Searched as Searched,
        SoundWatch as SoundWatch,
        search as search,
    )
    from jblast.signals.templates import (
        bank_of_pulses as bank_of_pulses,
        blast_template as blast_template,
    )

__getattr__, __dir__ = lazy_face(__name__)
