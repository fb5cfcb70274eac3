r"""How near the detectors come to what is possible, and what they cost.

    python -m calibration.detector_limits

Known noise: 90 dB of colour (`calibration/cases.py`). The bounds come
from integrals over the whole spectrum, $2E/N_0 = 4\int |H|^2/S\,df$ for a one-sided
$S$, not from the filter: that is shorter, and waits for nothing after the template. One
test at a known time finds $Q(Q^{-1}(p_f) - \sqrt{2E/N_0})$ of the blasts (Neyman and
Pearson), and no arrival has a smaller error than $1/(\beta\sqrt{2E/N_0})$ (Cramér and
Rao).

Real sound: `data/sound/` (PROVENANCE.md). Windows of 3 s, the noise unknown; a bang of
1 s at a level of rms over rms; the threshold is passed by the loudest moment of 1 % of
the windows without a bang.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import soundfile
from scipy.stats import norm

from calibration.cases import (
    RATE,
    coloured,
    plain_normalised,
    pulse,
    recorded_template,
    rumble,
)
from calibration.detector_costs import costs
from calibration.detector_figure import draw
from jblast.signals import (
    filtered,
    matched_kernel,
    noise_spectrum,
)
from jblast.signals.matched_filter import HALF_WIDTH, between_samples

HERE = Path(__file__).parent
SOUND, RESULTS = HERE / "data" / "sound", HERE / "results"
SEED = 19
SNRS = np.arange(-5.0, 20.1, 2.5)
FALSE = (1e-2, 1e-3, 1e-4, 1e-5)
LOUD = (15.0, 20.0, 25.0, 30.0, 35.0, 40.0)
ROWS = 1500
SOFT_HZ = 2000.0
LEVELS = (-15.0, -20.0, -25.0)
WINDOWS = 150
WINDOW_S = 3.0
FAR = 1.26
"""A bang that lasts so much longer: a blast at about three times the distance."""


class Limits(NamedTuple):
    """What was measured.

    Attributes:
        lines: The text, line by line.
        rates: Detection rates by false-alarm rate: measured and bound.
        arrivals: Error over bound, and mean over sigma, for each of `LOUD`, by pulse.
        misses: Share missed at each of `LEVELS`, by method.
        costs: Milliseconds a second by template.
    """

    lines: list[str]
    rates: dict[float, tuple[np.ndarray, np.ndarray]]
    arrivals: dict[str, list[tuple[float, float]]]
    misses: dict[str, list[float]]
    costs: dict[str, float]


def bounds(shape: np.ndarray) -> tuple[float, float]:
    """Return the square root of 2E/N0 of a template, and beta [rad/s]."""
    size = 2**20
    f = np.fft.rfftfreq(size, 1 / RATE)
    spectrum = np.abs(np.fft.rfft(shape, size) / RATE) ** 2
    weight = 4 * spectrum / np.interp(f, *rumble()[:2]) * (RATE / size) / 2
    energy = 2 * weight.sum()
    omega = 2 * np.pi * f
    return float(np.sqrt(energy)), float(
        np.sqrt(2 * np.sum(omega**2 * weight) / energy)
    )


def detection_rates() -> tuple[list[str], dict]:
    """Return detection rates against the bound, the noise known and measured."""
    shape, rng = pulse(0.02), np.random.default_rng(SEED)
    noise = coloured(rng, rumble(), 2**22)[0]
    learnt = noise_spectrum(coloured(rng, rumble(), 2**19)[0], RATE)
    possible, _ = bounds(shape)
    lines, rates = [], {}
    for name, spectrum in (("known", rumble()), ("from 11 s", learnt)):
        kernel = matched_kernel(shape, RATE, spectrum)
        # the blast goes through the same filter, alone: it is linear
        alone = np.zeros(2**15)
        alone[2**14 :][: shape.size] = shape
        answer = filtered(alone + kernel.offset, kernel)[2**14]
        quiet = filtered(noise, kernel)[kernel.before : -kernel.reach]
        worst = 0.0
        for false in FALSE:
            height, amounts = norm.isf(false), 10 ** (SNRS / 20)
            bound = norm.sf(height - amounts)
            seen = [np.mean(quiet + a / possible * answer > height) for a in amounts]
            off = np.abs(np.array(seen) - bound)
            worst = max(worst, float(off.max()))
            lines.append(
                f"  {name:10s} {false:7.0e} {np.mean(quiet > height):12.2e}"
                f" {seen[4]:9.4f} {bound[4]:9.4f} {off.max():9.4f}"
            )
            if name == "known":
                rates[false] = np.array(seen), bound
        lines.append(f"  {name:10s} worst of all {worst:.4f}")
    return lines, rates


def softened(shape: np.ndarray, band_hz: float) -> np.ndarray:
    """Return a pulse whose spectrum falls as a Gaussian, as far air leaves it.

    Args:
        shape: The pulse.
        band_hz: Where 4.3 dB are gone [Hz].
    """
    size = 2 * shape.size
    f = np.fft.rfftfreq(size, 1 / RATE)
    centred = np.pad(shape, (shape.size // 4, size - shape.size * 5 // 4))
    gain = np.exp(-0.5 * (f / band_hz) ** 2)
    return np.fft.irfft(np.fft.rfft(centred) * gain, size)[: shape.size * 3 // 2]


def arrival_errors(shape: np.ndarray) -> tuple[list[str], list[tuple[float, float]]]:
    """Return the errors of arrivals over the bound, for each of `LOUD`.

    Args:
        shape: The pulse.
    """
    rng, at = np.random.default_rng(SEED + 1), 6000
    turn = -2j * np.pi * np.fft.rfftfreq(12000)
    kernel = matched_kernel(shape, RATE, rumble())
    possible, beta = bounds(shape)
    parts = rng.uniform(size=ROWS)
    quiet, alone = np.empty((ROWS, 2000)), np.empty((ROWS, 2000))
    near = slice(at - 1000, at + 1000)
    for row, part in enumerate(parts):
        quiet[row] = filtered(coloured(rng, rumble(), 12000)[0], kernel)[near]
        # between samples as a recorder of this band has it
        spectrum = np.fft.rfft(shape, 12000) * np.exp(turn * (at + part))
        blast = np.fft.irfft(spectrum, 12000)
        alone[row] = filtered(blast, kernel)[near]
    lines, found = [], []
    for snr in LOUD:
        amount = 10 ** (snr / 20)
        heard = quiet + amount / possible * alone
        tops = heard[:, 952:1049].argmax(axis=1) + 952
        elsewhere = np.mean(np.abs(heard.argmax(axis=1) - 1000) > 48)
        errors = np.array(
            [
                (top + between_samples(row[top - HALF_WIDTH : top + HALF_WIDTH + 1])[0])
                - 1000
                - part
                for row, top, part in zip(heard, tops, parts, strict=True)
            ]
        )
        sigma = RATE / (beta * amount)
        found.append((float(errors.std() / sigma), float(errors.mean() / sigma)))
        lines.append(
            f"  {snr:4.0f} dB  {1e6 * sigma / RATE:8.3f} us  {found[-1][0]:6.3f}"
            f"  {found[-1][1]:+6.3f}  {elsewhere:7.4f}"
        )
    return lines, found


def stretched(shape: np.ndarray, factor: float) -> np.ndarray:
    """Return a sound that lasts longer, cut to its old length."""
    at = np.arange(shape.size) / factor
    return np.interp(at, np.arange(shape.size), shape)


def real_misses() -> tuple[list[str], dict[str, list[float]]]:
    """Return the share of bangs missed in real ambient sound, by method."""
    bang, rate = soundfile.read(SOUND / "bang.flac")
    ambient, _ = soundfile.read(SOUND / "ambient_birds.ogg")
    bang = recorded_template(bang, rate, 0.07, 1.0)
    length, rng = round(WINDOW_S * rate), np.random.default_rng(SEED + 2)
    starts = rng.integers(0, ambient.size - length, 2 * WINDOWS)
    places = rng.integers(round(0.1 * rate), length - bang.size, WINDOWS)

    def matched(template: np.ndarray):
        def loudest(window: np.ndarray) -> float:
            kernel = matched_kernel(template, rate, noise_spectrum(window, rate))
            inside = filtered(window, kernel)[kernel.before : -kernel.reach]
            return float(inside.max())

        return loudest

    methods = {
        "plain normalised": lambda window: float(plain_normalised(window, bang).max()),
        "matched, whitened": matched(bang),
        "matched, bang 1.26 times as long": matched(stretched(bang, FAR)),
    }
    lines, misses = [], {}
    for name, loudest in methods.items():
        quiet = [loudest(ambient[s:][:length]) for s in starts[:WINDOWS]]
        height, missed = np.quantile(quiet, 0.99), []
        for level in LEVELS:
            heard = 0
            for start, place in zip(starts[WINDOWS:], places, strict=True):
                window = ambient[start:][:length].copy()
                amount = window.std() / bang.std() * 10 ** (level / 20)
                window[place:][: bang.size] += amount * bang
                heard += loudest(window) > height
            missed.append(1 - heard / WINDOWS)
        misses[name] = missed
        lines.append(
            f"  {name:34s} {height:7.3g}  " + "".join(f"{m:8.3f}" for m in missed)
        )
    return lines, misses


def other_distances() -> list[str]:
    """Return what a template by the laws for another distance costs [dB]."""
    from jblast.signals import blast_template

    true = blast_template(5.0, 100.0, RATE)
    lines = []
    for distance in (25.0, 50.0, 80.0, 100.0, 125.0, 200.0, 400.0):
        other = matched_kernel(blast_template(5.0, distance, RATE), RATE, rumble())
        sound = np.zeros(2**15)
        sound[2**14 :][: true.size] = true
        best = filtered(sound, other)
        right = matched_kernel(true, RATE, rumble()).response
        late = (int(best.argmax()) - 2**14) / RATE
        lines.append(
            f"  {distance:5.0f} m  {20 * np.log10(best.max() / right):7.2f} dB"
            f"  arrival {1e6 * late:+7.0f} us"
        )
    return lines


def measured() -> Limits:
    """Measure everything."""
    rate_lines, rates = detection_rates()
    sharp_lines, sharp = arrival_errors(pulse(0.02))
    soft_lines, soft = arrival_errors(softened(pulse(0.02), SOFT_HZ))
    miss_lines, misses = real_misses()
    cost_lines, price = costs()
    lines = [
        "How near the detectors come to what is possible, and what they cost",
        "python -m calibration.detector_limits",
        "",
        "One test at a known time, 90 dB of colour, 20 ms, 2E/N0 from -5 to 20 dB,",
        "4e6 outputs: false alarms asked and had, rate at 5 dB, its bound, and the",
        "largest difference at any 2E/N0",
        "  noise        asked          had      rate     bound   largest",
        *rate_lines,
        "",
        f"Arrival, {ROWS} blasts between samples, loudest of 2 ms: bound of sigma,",
        "error over bound, mean error over sigma; share with a louder one in 42 ms",
        "  front of 0.2 ms, heard up to 24 kHz",
        *sharp_lines,
        f"  the same through a Gaussian of {SOFT_HZ:g} Hz",
        *soft_lines,
        "",
        "Bang of 1 s in birdsong outdoors (both real, CC0), rms over rms, 1 % false",
        f"alarms of windows of 3 s, {WINDOWS} of each: threshold, share missed at "
        + ", ".join(f"{level:g}" for level in LEVELS)
        + " dB",
        *miss_lines,
        "",
        "Template by the laws for another distance, 5 kg at 100 m in 90 dB of colour",
        *other_distances(),
        "",
        *cost_lines,
    ]
    return Limits(lines, rates, {"sharp": sharp, "soft": soft}, misses, price)


def main() -> None:
    """Measure, print, keep the table and the figure."""
    from jblast.cli.jax_start import start_jax

    start_jax()
    found = measured()
    text = "\n".join(found.lines) + "\n"
    print(text)
    (RESULTS / "detector_limits.txt").write_text(text)
    draw(found, RESULTS / "detector_limits.png", tuple(SNRS), LOUD, LEVELS)


if __name__ == "__main__":
    main()
