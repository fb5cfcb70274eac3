import pytest

from jblast.missions import read_plan


def test_a_pattern_is_written_once(jblast):
    file = jblast.path("field.plan")
    options = ("--grid", "40,20,10", "--home", "35.3,-80.7,200", "--up", "12")
    code, out, err = jblast("plan", file, *options, "--speed", "4")
    assert (code, err) == (0, "")
    assert "8 items" in out
    plan = read_plan(file)
    assert (plan.home, plan.hover_speed_m_s) == ((35.3, -80.7, 200.0), 4.0)
    assert "--force" in jblast.refused("plan", file, *options)
    assert jblast("plan", file, "--orbit", "-20,2", *options[2:], "--force")[0] == 0
    assert read_plan(file).items[1].params[:3] == (2, 0, -20)


REFUSED = {
    "no pattern": (["--home", "1,2"], "--grid"),
    "home": (["--orbit", "5", "--home", "95,2"], "between -90 and 90"),
    "spacing": (["--grid", "5,5,0", "--home", "5,2"], "SPACING"),
    "turns": (["--orbit", "5,0", "--home", "5,2"], "TURNS"),
}


@pytest.mark.parametrize(("options", "said"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_pattern_is_refused(jblast, options, said):
    assert said in jblast.refused("plan", jblast.path("a.plan"), *options)
    assert not (jblast.directory / "a.plan").exists()
