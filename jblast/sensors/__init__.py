"""The forward model from a scene to the readings and records of its sensors."""

from typing import TYPE_CHECKING

from jblast.lazy import lazy_face

if TYPE_CHECKING:
    from jblast.sensors.calculator import (
        Calculated as Calculated,
        Question as Question,
        Roots as Roots,
        calculate as calculate,
        roots as roots,
    )
    from jblast.sensors.forward_model import (
        Recording as Recording,
        record as record,
    )
    from jblast.sensors.law_choice import (
        resolve_laws as resolve_laws,
    )
    from jblast.sensors.layout import (
        Layout as Layout,
        layout_of as layout_of,
        planned_layout as planned_layout,
    )
    from jblast.sensors.recorder import recording as recording
    from jblast.sensors.simulated_readings import (
        observe as observe,
        readings as readings,
        simulate as simulate,
    )
    from jblast.sensors.sources import sampled_by as sampled_by
    from jblast.sensors.waves_met import (
        DEFAULT_RECORD_LAWS as DEFAULT_RECORD_LAWS,
        Track as Track,
        Wave as Wave,
        overpressure as overpressure,
        record_laws as record_laws,
        waves as waves,
    )

__getattr__, __dir__ = lazy_face(__name__)
