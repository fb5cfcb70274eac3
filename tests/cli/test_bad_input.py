import pytest

from tests.cli.cli_files import HEADER, TWO, says, table

# a log beneath the header of others, or a slash and a whole one; " / " ends a line
LOGS = table("""
/sensor,quantity,value / a,air_arrival_s,1 => line 1 | missing column sigma
a,air_arival_s,1,0.1,30,0,1 => line 2 | air_arival_s | did you mean air_arrival_s
a,air_arrival_s,abc,0.1,30,0,1 => line 2 | value | a finite number | 'abc'
a,air_arrival_s,1,-0.1,30,0,1 => sigma | -0.1
a,air_arrival_s,1,0,30,0,1 => sigma | positive
a,positive_duration_s,-1,0.1,30,0,1 => value | positive_duration_s | -1
a,air_arrival_s,1,1,3,0,1 / a,air_arrival_s,1,1,3,0,1 => line 3 | duplicate of line 2
a,air_arrival_s,nan,0.1,30,0,1 => a value in some row
a,air_arrival_s,1,inf,30,0,1 => sigma | inf
a,air_arrival_s,1,0.1,-inf,0,1 => east_m | -inf
/ => empty | header
/# nothing here => empty | header
 => nothing after the header
a,air_arrival_s,1 => line 2 | 7 fields | got 3
a,air_arrival_s,1,0.1,30,0,1,9 => line 2 | got 8
a,impulse_kPa_ms,1,0.1,30,0,1 => impulse_kPa_ms | positive_impulse_kpa_ms
/sensor,impulse_kPa_ms,range_m / a,1,2 => impulse_kPa_ms | positive_impulse_kpa_ms
a,air_arival_s,abc,-1,30 / b,impulse_kPa_ms,nan,0,1,2,3 => line 2
/sensor,quantity,value,sigma / a,air_arrival_s,1,.1 => range_m
""")
SCENES = table("""
[charge] / mas_kg = 1 => [charge] mas_kg | mass_kg
[chrge] => chrge | did you mean charge
[charge] / mass_kg = -1 => mass_kg | positive | -1
[charge => broken TOML | line 1
[charge] / mass_kg = { uniform = [3, 1] } => mass_kg | hi of uniform | above 3, got 1
[law] / air_arrival_s = "kingery" => kingery_bulmash
[[charge]] / name = "x" / [[charge]] / name = "y" => shot | 'x', 'y' | got nothing
[camera] => [camera] position_m | or mount with offset_m, got nothing
[vehicle] => [vehicle] model | got nothing
[world] / count = 0 => [world] count | got 0
[law] / positive_duration_s = "ford_2020" => _duration_s | did you mean ford_2021
[air] / altitude_m = 100 / temperature_k = 280 => altitude_m | temperature_k
[charge] / mass_kg = 1.0 => nothing to fit | --free
[[sensor]] / name = "a" / position_m = [1, 2, 3] => sensor 'a' | [30, 0, 1] | [1, 2, 3]
""")
OPTIONS = table("""
--free clock_offset_s.c => no such clock | expected one of a, b
--free clock_offset_s => clock_offset_s.NAME
--free charge_mass_kg.main => did you mean charge_mass_kg
--free charge_mas_kg => did you mean charge_mass_kg
--free charge_range_m,charge_east_m => charge_range_m | charge_east_m
--law nobody => expected auto | 'nobody'
--law air_arrival=wu_hao => did you mean air_arrival_s
--law air_arrival_s=ford_2021 => wu_hao | 'ford_2021'
--law ford_2021 => a quantity of the log
--law arrival_difference_s=wu_hao => air_arrival_s and ground_arrival_s
--noise cauchy => student | gaussian
--seed 3 => unrecognized
--scene  => expected a path
""")


@pytest.mark.parametrize(("rows", "said"), LOGS)
def test_a_bad_log_exits_2_with_says(jblast, rows, said):
    text = rows[1:] if rows[:1] == "/" else HEADER + rows
    text = "".join(f"{line}\n" for line in text.split(" / ") if line)
    says(jblast.refused("fit", jblast.file("log.csv", text), "--json"), said)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (TWO.encode("utf-16-le"), "control character"),
    ],
)
def test_a_log_in_another_encoding_is_refused(jblast, content, said):
    says(jblast.refused("fit", jblast.file("log.csv", content)), said)


@pytest.mark.parametrize(("content", "said"), SCENES)
def test_a_bad_scene_exits_2_with_says(jblast, content, said):
    content = content.replace(" / ", "\n") + "\n"
    log, scene = jblast.file("log.csv", TWO), jblast.file("scene.toml", content)
    says(jblast.refused("fit", log, "--scene", scene), said)


@pytest.mark.parametrize(("option", "said"), OPTIONS)
def test_a_bad_option_exits_2(jblast, option, said):
    err = jblast.refused("fit", jblast.file("log.csv", TWO), *option.split(" ", 1))
    assert all(part in err for part in said.split(" | "))


def test_a_log_and_a_scene_that_are_not_there_are_named(jblast):
    says(jblast.refused("fit", jblast.path("no.csv")), "no.csv | no such")
    log = jblast.file("log.csv", TWO)
    err = jblast.refused("fit", log, "--scene", jblast.path("no.toml"))
    says(err, "no.toml | no such")


def test_a_place_that_cannot_be_written_is_refused_before_the_fit(jblast, tmp_path):
    log = jblast.file("log.csv", TWO)
    (tmp_path / "full").mkdir()
    jblast.file("full/held", "mine")
    jblast.file("full/fit.json", "mine")
    for out, words in (
        ("full", "fit.json | exists already | --force"),
        ("full/held", "File exists"),
        ("full/held/deeper", "Not a directory"),
    ):
        says(jblast.refused("fit", log, "--out", jblast.path(out)), words)
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
