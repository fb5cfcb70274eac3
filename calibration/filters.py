"""What does a causal filter do otherwise than the averaging filter of the thesis?

    python -m calibration.filters > calibration/results/filters.txt

No data, no random numbers. Writes calibration/results/filters.png: step responses and
gains.

Both are set to 25 Hz at 48 kHz. "heard before" is when the response to a step first
passes a thousandth, before (minus: after) the step; "half way" when it passes a half;
"overshoot" by how much it passes 1; the corner is where 3 dB are lost. The seconds, the
best of nine, are those of one second of 48 kHz through a band-pass of second order,
20 Hz to 8 kHz, float32, on the cores of one machine: by chunks, as
`sensors/instrument.py` does it, and by a step a sample.
"""

import os
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jblast.cli.jax_start import start_jax
from jblast.fidelity.timing import best_of
from jblast.report.figure_files import write_figure
from jblast.report.figure_style import COLOURS, new_figure, quiet, titled
from jblast.sensors import instrument
from jblast.sensors.instrument import (
    CUTOFF_HZ,
    CausalFilter,
    causal_filter,
    filter_block,
    filter_start,
    moving_average,
)

RATE = 48e3
FIGURE = Path(__file__).parent / "results" / "filters.png"
AT = 24_000
"""Sample of the step, half a second in."""
CHUNKS = (8, 16, 32, 64, 128)
MICROPHONES = (1, 1000)


def responses() -> dict[str, np.ndarray]:
    """Return what each makes of a step, by name."""
    step = np.zeros(4 * AT)
    step[AT:] = 1.0
    made = {"averaging": np.asarray(moving_average(jnp.asarray(step), RATE))}
    for order in (1, 2, 4):
        filtering = causal_filter(RATE, low_pass=CUTOFF_HZ, order=order)
        _, filtered = filter_block(
            filtering, filter_start(filtering), jnp.asarray(step)
        )
        made[f"Butterworth, order {order}"] = np.asarray(filtered)
    return made


def gain(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies [Hz], and the gain of the filter with a step response."""
    impulse = np.diff(step, prepend=0.0)
    impulse = impulse[: 3 * AT]  # the averaging filter has fewer samples at its end
    return np.fft.rfftfreq(impulse.size, 1 / RATE), np.abs(np.fft.rfft(impulse))


def show(made: dict[str, np.ndarray]) -> None:
    """Print the comparison."""
    print(f"  {'':24s}heard before  half way  overshoot  corner    lost [dB] at")
    print(
        f"  {'low-pass, 25 Hz':24s}        [ms]      [ms]        [%]    [Hz]"
        "  50 Hz 100 Hz"
    )
    for name, step in made.items():
        middle = step[: 3 * AT]
        first = np.flatnonzero(np.abs(middle) > 1e-3)[0]
        half = np.flatnonzero(middle >= 0.5)[0]
        frequency, left = gain(step)
        corner = np.flatnonzero(left < 10 ** (-3.0103 / 20))[0]
        at = frequency[corner - 1 : corner + 1]
        corner_hz = np.interp(-(2**-0.5), -left[corner - 1 : corner + 1], at)
        lost = -20 * np.log10(np.interp([50.0, 100.0], frequency, left))
        print(
            f"  {name:24s}{1e3 * (AT - first) / RATE:12.2f} "
            f"{1e3 * (half - AT) / RATE:9.2f} {100 * max(middle.max() - 1, 0.0):10.1f} "
            f"{corner_hz:7.2f} {lost[0]:6.1f} {lost[1]:6.1f}"
        )


def by_sample(filtering: CausalFilter, samples: jax.Array) -> jax.Array:
    """Filter a step a sample, for comparison."""
    a, b = filtering.powers[1], filtering.kept[:, -1]
    c, d = filtering.heard[0], filtering.response[0, 0]

    def step(state: jax.Array, x: jax.Array) -> tuple[jax.Array, jax.Array]:
        return a @ state + b * x, c @ state + d * x

    return lax.scan(step, filter_start(filtering), samples)[1]


def by_chunk(filtering: CausalFilter, samples: jax.Array) -> jax.Array:
    """Filter as the package does."""
    return filter_block(filtering, filter_start(filtering), samples)[1]


def seconds(filtering: CausalFilter, run, microphones: int) -> float:
    """Return how long a second of sound takes, the best of nine."""
    single = jax.tree.map(lambda x: x.astype(jnp.float32), filtering)
    samples = jnp.zeros((microphones, int(RATE)), jnp.float32).at[:, 5].set(1.0)
    compiled = jax.jit(jax.vmap(run, in_axes=(None, 0)))
    return best_of(lambda: compiled(single, samples), 9)[0]


def show_seconds() -> None:
    """Print how long each way takes."""
    print(f"\n  seconds for one second, {os.cpu_count()} cores")
    print("  microphones" + "".join(f"{n:10d}" for n in MICROPHONES))
    kept = instrument.CHUNK
    for chunk in CHUNKS:
        instrument.CHUNK = chunk
        band = causal_filter(RATE, 20.0, 8e3)
        taken = [seconds(band, by_chunk, n) for n in MICROPHONES]
        mark = " (kept)" if chunk == kept else ""
        print(f"  chunks {chunk:4d} " + "".join(f"{t:10.4f}" for t in taken) + mark)
    instrument.CHUNK = kept
    band = causal_filter(RATE, 20.0, 8e3)
    taken = [seconds(band, by_sample, n) for n in MICROPHONES]
    print("  a sample    " + "".join(f"{t:10.4f}" for t in taken))


def draw(made: dict[str, np.ndarray]) -> None:
    """Write the figure."""
    figure = new_figure(10.0, 4.2)
    left, right = figure.subplots(1, 2)
    milliseconds = 1e3 * (np.arange(4 * AT) - AT) / RATE
    for (name, step), colour in zip(made.items(), COLOURS, strict=False):
        shown = (milliseconds > -20) & (milliseconds < 60)
        left.plot(milliseconds[shown], step[shown], color=colour, label=name)
        frequency, gains = gain(step)
        shown = (frequency >= 2) & (frequency <= 400)
        decibels = 20 * np.log10(np.maximum(gains[shown], 1e-4))
        right.plot(frequency[shown], decibels, color=colour)
    left.set(xlabel="time since the step [ms]", ylabel="response")
    left.legend(frameon=False, fontsize=9)
    right.set(xscale="log", xlabel="frequency [Hz]", ylabel="gain [dB]", ylim=(-60, 5))
    for axes, title in ((left, "a step"), (right, "tones")):
        titled(axes, title)
        quiet(axes)
    write_figure(figure, FIGURE)


def main() -> None:
    """Print the tables and draw."""
    start_jax()
    made = responses()
    show(made)
    show_seconds()
    draw(made)


if __name__ == "__main__":
    main()
