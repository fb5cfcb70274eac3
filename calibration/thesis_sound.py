"""The thesis's pictures of sound, drawn again: its figures 3.7, 3.8, 4.3 and 4.4.

python -m calibration.thesis_sound

15 kg of TNT on granite, 20 m from a microphone on the ground, which is what its table
of propagation times is reckoned with. Its sounds are recordings in units of their own;
ours are pascals: the wave in air of a charge on the ground, the wave in the ground as
what the moving ground does to the air above it, and a background of pink noise.

- 3.7, 4.3: the whole wave form. 4.3's blast is where the thesis observed it, at 1.9 s.
- 3.8: the same with the wave in air 0.6 s later, to tell the two apart by eye.
- 4.4: around the arrivals: the ground's wave, and then the air's.

The thesis makes its ground wave from the bang itself, by an averaging filter with a
corner of 25 Hz. Drawn beside ours, it comes before its own arrival: a mean over as much
of the future as of the past. Ours is short and quiet, by a law of rock whose recordings
begin at Z = 25 m/kg^(1/3): here Z is 8, so take its size as a guess.
"""

import argparse
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jblast.cli.jax_start import start_jax
from jblast.files import write_text
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import (
    BLUE,
    INK,
    MUTED,
    VERMILLION,
    new_figure,
    quiet,
    titled,
)
from jblast.report.words import aligned
from jblast.scene import Air, Ambient, Charge, Ground, Instrument, Scene, Sensor
from jblast.sensors import heard, microphone, overpressure
from jblast.sensors.instrument import moving_average
from jblast.sensors.wave_paths import ground_laws, ground_waves

MASS_KG, RANGE_M = 15.0, 20.0
P_SPEED_M_S, SOUND_SPEED_M_S = 6000.0, 340.0
"""As the thesis takes them."""
OBSERVED_S = {"ground": 1.88535, "air": 1.91778}
"""Its section 4.2.1.1, of a blast 10 to 20 m away: 32.43 ms apart."""
TIME_S = OBSERVED_S["ground"] - 0.00314
"""Detonation, such that the ground's wave comes when the thesis saw it."""
RATE_HZ, SECONDS = 44_100.0, 4.0
DELAY_S = 0.6
"""Of the wave in air in figure 3.8."""
BACKGROUND_PA = 0.1
"""74 dB, declared: a loud background, so that it can be seen at all."""
LAWS = {"air_arrival_s": "wu_hao", "ground_arrival_s": "wu_hao"}


class Sounds(NamedTuple):
    """What the microphone hears, sample by sample [Pa].

    Attributes:
        both: Background and both waves.
        delayed: The same with the wave in air later.
        air: The wave in air alone.
        averaged: That one, filtered and begun at the ground's arrival, as the thesis
            makes its ground wave.
        arrivals_s: Of both waves.
    """

    both: Float[np.ndarray, " sample"]
    delayed: Float[np.ndarray, " sample"]
    air: Float[np.ndarray, " sample"]
    averaged: Float[np.ndarray, " sample"]
    arrivals_s: dict[str, float]


def sounds() -> Sounds:
    """Return what is heard."""
    scene = Scene(
        Charge(mass_kg=MASS_KG, time_s=TIME_S),
        air=Air(sound_speed=SOUND_SPEED_M_S),
        ground=Ground(p_speed=P_SPEED_M_S, path="thesis"),
        ambient=Ambient(level=BACKGROUND_PA, slope=-3.0),
        law=tuple(LAWS.items()),
    )
    place = np.array([RANGE_M, 0.0, 0.0])
    phone = Sensor("phone", place, "microphone", instrument=Instrument(rate=RATE_HZ))
    both = microphone.record(scene, phone, SECONDS, jax.random.key(0))
    edges = np.arange(both.size + 1) / RATE_HZ
    air = np.asarray(overpressure(scene, place, edges))
    (wave,) = ground_waves(scene, jnp.asarray(place), ground_laws(scene))
    front = int(np.flatnonzero(air)[0])
    arrivals = {
        "ground": float(wave.arrival_time),
        "air": float(heard(scene, place)[0].pulse.arrival_time),
    }
    late = round(DELAY_S * RATE_HZ)
    early = front - round(arrivals["ground"] * RATE_HZ)
    averaged = np.asarray(moving_average(np.roll(air, -early), RATE_HZ))
    return Sounds(
        both=np.asarray(both),
        delayed=np.asarray(both) - air + np.roll(air, late),
        air=air,
        averaged=averaged,
        arrivals_s=arrivals,
    )


def sound_figure(sound: Sounds) -> Figure:
    """Draw the four figures, in the thesis's order."""
    figure = new_figure(11.0, 7.4)
    (whole, delayed), (output, near) = figure.subplots(2, 2)
    time = np.arange(sound.both.size) / RATE_HZ
    shown = (time > TIME_S - 0.4) & (time < TIME_S + 1.2)
    _draw(whole, time[shown] - TIME_S, sound.both[shown] / 1e3)
    titled(whole, "Figure 3.7", "the wave form, since the detonation")
    _draw(delayed, time[shown] - TIME_S, sound.delayed[shown])
    titled(delayed, "Figure 3.8", f"the air's wave {DELAY_S:g} s later, for debugging")
    _draw(output, time, sound.both)
    titled(output, "Figure 4.3", "all that the microphone gives out")
    ground, air = (sound.arrivals_s[name] - TIME_S for name in ("ground", "air"))
    window = (time > TIME_S - 0.012) & (time < TIME_S + 0.06)
    since = 1e3 * (time[window] - TIME_S)
    near.plot(since, sound.averaged[window], color=VERMILLION, linewidth=1.2)
    near.text(17.0, 300.0, "as the thesis makes it", color=VERMILLION, fontsize=9)
    _draw(near, since, sound.both[window])
    titled(near, "Figure 4.4", "the ground's wave, then the air's")
    for axes, unit in ((whole, "s"), (delayed, "s"), (near, "ms")):
        size = 1e3 if unit == "ms" else 1.0
        later = DELAY_S if axes is delayed else 0.0
        axes.axvline(size * ground, color=MUTED, linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.axvline(
            size * (air + later), color=INK, linewidth=0.9, linestyle=(0, (4, 3))
        )
        axes.set_xlabel(f"time since the detonation [{unit}]")
    output.set_xlabel("time [s]")
    whole.set_ylabel("overpressure [kPa]")
    for axes in (delayed, output, near):
        # the waves differ by orders of magnitude: logarithmic, straight about zero
        axes.set_yscale("symlog", linthresh=1.0, linscale=1.0)
        axes.set_yticks([-1e4, -1e2, -1.0, 0.0, 1.0, 1e2, 1e4])
        axes.set_ylim(-2e4, 6e4)
        axes.set_ylabel("overpressure [Pa]")
    return figure


def _draw(
    axes: Axes, time: Float[np.ndarray, " n"], samples: Float[np.ndarray, " n"]
) -> None:
    quiet(axes)
    axes.plot(time, samples, color=BLUE, linewidth=0.9)
    axes.set_xlim(time[0], time[-1])


def table(sound: Sounds) -> str:
    """Return the numbers of the pictures."""
    ground, air = sound.arrivals_s["ground"], sound.arrivals_s["air"]
    before_air = np.arange(sound.both.size) / RATE_HZ < air - 1.0 / RATE_HZ
    averaged = np.flatnonzero(np.abs(sound.averaged) > 1e-3 * sound.averaged.max())
    background = sound.both[: round((TIME_S - 0.1) * RATE_HZ)]
    observed = 1e3 * (OBSERVED_S["air"] - OBSERVED_S["ground"])
    rows = [
        ("", "here", "thesis"),
        ("ground arrival [ms]", f"{1e3 * (ground - TIME_S):.2f}", ""),
        ("air arrival [ms]", f"{1e3 * (air - TIME_S):.2f}", ""),
        ("air minus ground [ms]", f"{1e3 * (air - ground):.2f}", f"{observed:.2f}"),
        ("peak of the air's wave [Pa]", f"{sound.air.max():.0f}", ""),
        (
            "peak before it [Pa]",
            f"{np.abs(sound.both[before_air]).max():.1f}",
            "",
        ),
        ("peak of the averaged bang [Pa]", f"{sound.averaged.max():.0f}", ""),
        (
            "which begins before its arrival by [ms]",
            f"{1e3 * (ground - averaged[0] / RATE_HZ):.1f}",
            "",
        ),
        ("background, rms [Pa]", f"{background.std():.3f}", ""),
    ]
    lead = (
        f"{MASS_KG:g} kg at {RANGE_M:g} m, {RATE_HZ:g} samples a second; written by "
        "calibration/thesis_sound.py"
    )
    return "\n".join([lead, "", *aligned(rows, right=(1, 2))]) + "\n"


def main() -> None:
    """Draw and print."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--out", default="calibration/results/thesis_sound.png")
    options.add_argument("--table", default="calibration/results/thesis_sound.txt")
    asked = options.parse_args()
    start_jax(quick=True)
    sound = sounds()
    write_figure(sound_figure(sound), asked.out)
    write_text(asked.table, table(sound))
    print(table(sound), end="")


if __name__ == "__main__":
    main()
