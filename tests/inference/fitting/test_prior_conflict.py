"""A prior that excludes the data is told, and is not blamed for bad data."""

from jblast.inference import fit
from jblast.report.messages import sentences_of
from jblast.scene import Air, LogNormal, Scene, UncertainScene
from jblast.waves import kingery_bulmash_pressure
from tests.inference.logs import log

LAW = (("peak_overpressure_pa", "kingery_bulmash"),)
SCENE = Scene(air=Air(sound_speed=340.0), scatter=False, law=LAW)


def warnings(belief, *factors):
    """What is said of pressures of 15 kg, each times a factor, and a prior."""
    rows = [
        (f"s{i}", "peak_overpressure_pa", f * p, 0.05 * p, r)
        for i, (r, f) in enumerate(zip((10.0, 20.0, 30.0, 40.0), factors, strict=True))
        for p in [float(kingery_bulmash_pressure(r, 15.0))]
    ]
    uncertain = UncertainScene(SCENE, {"charge_mass_kg": belief}, "scene.toml")
    answer = fit(log(*rows, at_range=True), uncertain, noise="gaussian").summary
    assert "poor_fit" in [problem.kind for problem in answer.problems]
    return sentences_of(answer.warnings)


def test_a_prior_that_excludes_the_data_is_named_with_what_they_say():
    (sentence,) = warnings(LogNormal(5000.0, 1.05), 1.0, 1.0, 1.0, 1.0)
    # and not that the log tells nothing of the mass
    assert sentence.startswith("without priors the log fits well, at charge mass 15 kg")
    assert "which a prior excludes" in sentence


def test_readings_that_contradict_one_another_are_not_blamed_on_a_prior():
    assert warnings(LogNormal(5000.0, 1.05), 1.0, 3.0, 1.0, 3.0) == []
    assert warnings(LogNormal(20.0, 1.5), 1.0, 3.0, 1.0, 3.0) == []
