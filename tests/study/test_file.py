import pytest

from jblast.errors import InputError
from jblast.scene import LogUniform
from jblast.study import read_study, run_into
from jblast.study.slabs import parts_of
from tests.study.example import SCENE, STUDY, study_in, written

SAYS = {
    "seeds = 1": "seeds: expected one of scene, .*unknown key; did you mean seed",
    'design = "sobel"': "design: expected one of random, .*did you mean sobol",
    "samples = true": "samples: expected a whole.*got True",
    "sd_target = { air_arival_s = 1.0 }": "did you mean air_arrival_s",
    'keep = "some"': "keep: expected a whole .*, or .all.",
    'outcomes = ["air_arrival_s", "air_arrival_s"]': "each once, got air_arrival_s 2",
    "[axes]\norigin_time_s = { from = 0, to = 1, scale = 'log' }": "above 0",
    "[axes]\ncharge_mas_kg = [1]": "did you mean charge_mass_kg",
    "[axes]\ncharge_mass_kg = [0.0]": "expected a .*positive, got 0.0",
    "[axes]\ncharge_mass_kg = { from = 2, to = 1 }": "expected from < to",
    "[axes]\ncharge_mass_kg = { from = 1, to = 2, counts = 3 }": "did you mean count",
    '[axes]\n"charge.position_m.x" = [1]': "position_m: expected one of",
}


@pytest.mark.parametrize("line", SAYS)
def test_bad_input_is_one_message_with_the_key(tmp_path, line):
    key = line.partition(" ")[0]
    kept = [row for row in STUDY.splitlines() if row.partition(" ")[0] != key]
    path = written(tmp_path, "\n".join([*kept, line]) + "\n")
    with pytest.raises(InputError, match=SAYS[line]) as error:
        read_study(path)
    assert str(error.value).startswith(str(path))


def test_an_unknown_outcome_names_the_nearest(tmp_path):
    text = STUDY.replace('"air_arrival_s"', '"air_arival_s"')
    with pytest.raises(InputError, match="did you mean air_arrival_s"):
        parts_of(study_in(tmp_path, text), 0)


def test_code_is_refused_unless_asked_for(tmp_path):
    text = STUDY.replace('"air_arrival_s"', '"python:math.sqrt"')
    with pytest.raises(InputError, match="allow"):
        parts_of(study_in(tmp_path, text), 0)


def test_a_free_number_is_refused_unless_an_axis_sets_it(tmp_path):
    scene = SCENE.replace("{ lognormal = [10.0, 2.0] }", '"free"')
    with pytest.raises(InputError, match="charge_mass_kg is free and cannot be drawn"):
        study_in(tmp_path, scene=scene)
    text = STUDY + "[axes]\ncharge_mass_kg = [1.0, 2.0]\n"
    study = study_in(tmp_path, text, scene)
    assert study.drawn == ("origin_time_s",)
    assert study.cells == ((1.0,), (2.0,))
    assert "charge_mass_kg" in study.believed[0].beliefs


def test_a_range_without_a_count_is_drawn_and_words_make_variants(tmp_path):
    text = STUDY + (
        "[axes]\ncharge_mass_kg = { from = 1, to = 10, scale = 'log' }\n"
        '"sensor.far.position_m" = [[0.0, 50.0, 0.0], [0.0, 60.0, 0.0]]\n'
    )
    study = study_in(tmp_path, text)
    assert study.cells == ((),)
    far = [float(one.scene.sensors[1].position_m[1]) for one in study.variants]
    assert far == [50.0, 60.0]
    prior = study.uncertain.beliefs["charge_mass_kg"]
    assert isinstance(prior, LogUniform)
    assert float(prior.hi) == 10.0


def test_a_changed_study_is_not_gone_on_with_and_says_what_changed(tmp_path):
    run_into(study_in(tmp_path), tmp_path / "store")
    other = study_in(tmp_path, STUDY.replace("seed = 7", "seed = 8"))
    with pytest.raises(InputError, match="seed was 7, is 8"):
        run_into(other, tmp_path / "store", resume=True)
    moved = study_in(tmp_path, scene=SCENE.replace("20.0, 0.0", "21.0, 0.0"))
    with pytest.raises(InputError, match=r"scene has changed.*is \[21.0, 0.0, 0.0\]"):
        run_into(moved, tmp_path / "store", resume=True)
    with pytest.raises(InputError, match="expected a new store"):
        run_into(study_in(tmp_path), tmp_path / "store")
