import pytest

from tests.cli.cli_files import HEADER, TWO

ROW = "a,air_arrival_s,1,0.1,30,0,1\n"

LOGS = {
    "a missing column": (
        "sensor,quantity,value\na,air_arrival_s,1\n",
        ["line 1", "missing column sigma"],
    ),
    "an unknown quantity": (
        HEADER + ROW.replace("arrival", "arival"),
        ["line 2", "air_arival_s", "did you mean air_arrival_s"],
    ),
    "no number": (
        HEADER + ROW.replace(",1,0.1", ",abc,0.1"),
        ["line 2", "value", "a finite number", "'abc'"],
    ),
    "a negative sigma": (HEADER + ROW.replace("0.1", "-0.1"), ["sigma", "-0.1"]),
    "a sigma of zero": (HEADER + ROW.replace("0.1", "0"), ["sigma", "positive"]),
    "a negative duration": (
        HEADER + "a,positive_duration_s,-1,0.1,30,0,1\n",
        ["value", "positive_duration_s", "-1"],
    ),
    "a duplicate": (HEADER + ROW + ROW, ["line 3", "duplicate of line 2"]),
    "NaN alone": (HEADER + ROW.replace(",1,0.1", ",nan,0.1"), ["without a value"]),
    "infinity": (HEADER + ROW.replace("0.1", "inf"), ["sigma", "inf"]),
    "an infinite place": (HEADER + ROW.replace("30", "-inf"), ["east_m", "-inf"]),
    "an empty file": ("", ["empty", "header"]),
    "comments alone": ("# nothing here\n", ["empty", "header"]),
    "a header alone": (HEADER, ["nothing after the header"]),
    "Latin-1": (HEADER.encode() + b"caf\xe9" + ROW[1:].encode(), ["line 2", "UTF-8"]),
    "UTF-16 unmarked": ((HEADER + ROW).encode("utf-16-le"), ["control character"]),
    "a short row": (HEADER + "a,air_arrival_s,1\n", ["line 2", "7 fields", "got 3"]),
    "a long row": (HEADER + ROW.replace("\n", ",9\n"), ["line 2", "got 8"]),
    "another tool's quantity": (
        HEADER + "a,impulse_kPa_ms,1,0.1,30,0,1\n",
        ["impulse_kPa_ms", "positive_impulse_pa_s"],
    ),
    "another tool's column": (
        "sensor,impulse_kPa_ms,range_m\na,1,2\n",
        ["impulse_kPa_ms", "positive_impulse_pa_s"],
    ),
    "several faults at once": (
        HEADER + "a,air_arival_s,abc,-1,30\nb,impulse_kPa_ms,nan,0,1,2,3\n",
        ["line 2"],
    ),
    "no place": ("sensor,quantity,value,sigma\na,air_arrival_s,1,.1\n", ["range_m"]),
}

SCENES = {
    "an unknown key": ("[charge]\nmas_kg = 1\n", ["[charge] mas_kg", "mass_kg"]),
    "an unknown table": ("[chrge]\n", ["chrge", "did you mean charge"]),
    "a negative mass": ("[charge]\nmass_kg = -1\n", ["mass_kg", "positive", "-1"]),
    "broken TOML": ("[charge\n", ["broken TOML", "line 1"]),
    "lo above hi": (
        "[charge]\nmass_kg = { uniform = [3, 1] }\n",
        ["mass_kg", "lo < hi", "[3, 1]"],
    ),
    "a law nobody knows": ('[law]\nair_arrival_s = "kingery"\n', ["kingery_bulmash"]),
    "two charges": (
        '[[charge]]\nname = "x"\n[[charge]]\nname = "y"\n',
        ["column shot", "'x', 'y'", "got nothing"],
    ),
    "a camera without a place": ("[camera]\n", ["[camera] position_m", "got nothing"]),
    "a vehicle without a model": ("[vehicle]\n", ["[vehicle] model", "got nothing"]),
    "a world of nothing": ("[world]\ncount = 0\n", ["[world] count", "got 0"]),
    "no such law, for what the log lacks": (
        '[law]\npositive_duration_s = "ford_2020"\n',
        ["positive_duration_s", "did you mean ford_2021"],
    ),
    "altitude and temperature": (
        "[air]\naltitude_m = 100\ntemperature_k = 280\n",
        ["altitude_m", "temperature_k"],
    ),
    "nothing free": ("[charge]\nmass_kg = 1.0\n", ["nothing to fit", "--free"]),
    "another place": (
        '[[sensor]]\nname = "a"\nposition_m = [1.0, 2.0, 3.0]\n',
        ["sensor 'a'", "[30, 0, 1]", "[1, 2, 3]"],
    ),
}

OPTIONS = {
    "--free clock_offset_s.c": ["no such clock", "expected one of a, b"],
    "--free clock_offset_s": ["clock_offset_s.NAME"],
    "--free charge_mass_kg.main": ["did you mean charge_mass_kg"],
    "--free charge_mas_kg": ["did you mean charge_mass_kg"],
    "--free charge_range_m,charge_east_m": ["charge_range_m", "charge_east_m"],
    "--law nobody": ["expected auto", "'nobody'"],
    "--law air_arrival=wu_hao": ["did you mean air_arrival_s"],
    "--law air_arrival_s=ford_2021": ["wu_hao", "'ford_2021'"],
    "--law ford_2021": ["a quantity of the log"],
    "--law positive_impulse_pa_s=ford_2021": ["a quantity of the log"],
    "--law arrival_difference_s=wu_hao": ["air_arrival_s and ground_arrival_s"],
    "--noise cauchy": ["student", "gaussian"],
    "--seed 3": ["unrecognized"],
    "--scene ": ["expected a path"],
}


def one_message(err: str, words: list[str]) -> None:
    assert err.startswith("jblast: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize(("content", "words"), LOGS.values(), ids=LOGS)
def test_a_bad_log_exits_2_with_one_message(jblast, content, words):
    log = jblast.file("log.csv", content)
    one_message(jblast.refused("fit", log, "--json"), words)


@pytest.mark.parametrize(("content", "words"), SCENES.values(), ids=SCENES)
def test_a_bad_scene_exits_2_with_one_message(jblast, content, words):
    log, scene = jblast.file("log.csv", TWO), jblast.file("scene.toml", content)
    one_message(jblast.refused("fit", log, "--scene", scene), words)


@pytest.mark.parametrize(("option", "words"), OPTIONS.items(), ids=OPTIONS)
def test_a_bad_option_exits_2(jblast, option, words):
    log = jblast.file("log.csv", TWO)
    err = jblast.refused("fit", log, *option.split(" ", 1))
    for word in words:
        assert word in err


def test_a_log_and_a_scene_that_are_not_there_are_named(jblast):
    one_message(jblast.refused("fit", jblast.path("no.csv")), ["no.csv", "no such"])
    log = jblast.file("log.csv", TWO)
    err = jblast.refused("fit", log, "--scene", jblast.path("no.toml"))
    one_message(err, ["no.toml", "no such"])


def test_a_place_that_cannot_be_written_is_refused_before_the_fit(jblast, tmp_path):
    log = jblast.file("log.csv", TWO)
    (tmp_path / "full").mkdir()
    jblast.file("full/held", "mine")
    for out, words in (
        ("full", ["already holds files", "--force"]),
        ("full/held", ["a file"]),
        ("full/held/deeper", ["is a file"]),
    ):
        one_message(jblast.refused("fit", log, "--out", jblast.path(out)), words)
    assert jblast.text("full/held") == "mine"


def test_debug_adds_the_traceback(jblast):
    code, out, err = jblast("fit", jblast.path("no.csv"), "--debug")
    assert (code, out) == (2, "")
    assert "Traceback" in err
    assert err.splitlines()[-1].startswith("jblast: ")


def test_no_verb_and_an_unknown_verb_exit_2_and_say_which_there_are(jblast):
    for arguments in ((), ("frobnicate",)):
        err = jblast.refused(*arguments)
        assert all(verb in err for verb in ("fit", "scene", "simulate"))


def test_help_names_every_parameter_that_can_be_freed(jblast):
    from jblast.scene import PARAMETERS

    code, out, _ = jblast("fit", "--help")
    assert code == 0
    assert ", ".join(PARAMETERS) in " ".join(out.split())
    assert "sensor,quantity,value,sigma" in out
