import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from scipy.integrate import solve_ivp

from docs.generate.documents import schema
from tests.cli.cli_files import Command, says, table

TIME = np.linspace(0.0, 10.0, 301)


def columns_of(*columns: np.ndarray, header: str) -> str:
    rows = "\n".join(
        ",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True)
    )
    return f"{header}\n{rows}\n"


def pushed(noise: float = 0.02, cube: float = 0.0) -> str:
    """Return a body with drag of both kinds that is pushed to and fro."""
    push = 6.0 * np.sin(1.5 * TIME)
    flow = solve_ivp(
        lambda t, u: (
            np.interp(t, TIME, push) - 0.3 * u - 0.05 * np.abs(u) * u - cube * u**3
        ),
        (0.0, 10.0),
        [8.0],
        t_eval=TIME,
        max_step=0.02,
    )
    drawn = noise * np.random.default_rng(0).standard_normal(TIME.shape)
    return columns_of(TIME, flow.y[0] + drawn, push, header="time_s,u_m_s,push_m_s2")


def discovered(jblast: Command, content: str, *options: str):
    path = jblast.file("flight.csv", content)
    return jblast("discover", path, "--ensemble", "20", *options)


def test_json_is_all_of_stdout(jblast):
    options = ("--input", "push_m_s2", "--drag", "--json")
    code, out, _ = discovered(jblast, pushed(), *options)
    assert code == 0
    answer = json.loads(out)
    Draft202012Validator(schema("discover")).validate(answer)
    assert (answer["state"], answer["input"]) == (["u_m_s"], ["push_m_s2"])
    assert answer["rows"] == len(TIME)
    found = answer["equations"]["u_m_s"]
    terms = {term["term"]: term for term in found["terms"]}
    assert set(terms) == {"u_m_s", "push_m_s2", "|u_m_s| u_m_s"}
    for name, truth in (("u_m_s", -0.3), ("push_m_s2", 1.0), ("|u_m_s| u_m_s", -0.05)):
        term = terms[name]
        assert term["coefficient"] == pytest.approx(truth, rel=0.1)
        assert term["q05"] < term["coefficient"] < term["q95"]
        assert 0.5 < term["inclusion"] <= 1.0
    assert found["noise_sd"] == pytest.approx(0.02, rel=0.15)
    assert answer["reproduced"] is True
    assert answer["interval"]["nominal"] == 0.9


def test_equations_that_do_not_give_the_data_back_exit_with_four(jblast):
    # two oscillators beat; one of them, and its own first power alone, cannot
    beat = np.sin(2.0 * TIME) + np.sin(2.6 * TIME)
    content = columns_of(TIME, beat, header="time_s,x")
    code, out, _ = discovered(jblast, content, "--json")
    assert code == 4
    assert json.loads(out)["reproduced"] is False
    code, out, _ = discovered(jblast, content)
    assert code == 4
    assert "not reproduced" in out


def swings() -> list[np.ndarray]:
    """Return a damped oscillator from two starts, 250 and 200 rows of 20 ms."""
    rng = np.random.default_rng(1)

    def swing(rows: int, *start: float) -> np.ndarray:
        time = 0.02 * np.arange(rows)
        flow = solve_ivp(
            lambda t, y: (y[1], -4.0 * y[0] - 0.4 * y[1]),
            (0.0, 5.0),
            start,
            t_eval=time,
            rtol=1e-8,
        )
        noise = 0.003 * rng.standard_normal(flow.y.shape)
        return np.vstack([time, flow.y + noise])

    return [swing(250, 1.0, 0.0), swing(200, -0.5, 1.5)]


def test_runs_are_joined_by_a_column_and_a_jump_without_it_is_named(jblast):
    both = np.concatenate(swings(), axis=1)
    number = np.repeat([1, 2], [250, 200])
    text = columns_of(*both, number, header="time_s,x_m,v_m_s,run")
    code, out, _ = discovered(jblast, text, "--json")
    answer = json.loads(out)
    assert (code, answer["state"]) == (0, ["x_m", "v_m_s"])
    terms = answer["equations"]["v_m_s"]["terms"]
    found = {term["term"]: term["coefficient"] for term in terms}
    assert found == pytest.approx({"x_m": -4.0, "v_m_s": -0.4}, rel=0.02)
    both[0] = 0.02 * np.arange(450)
    code, out, _ = discovered(jblast, columns_of(*both, header="time_s,x_m,v_m_s"))
    assert code == 4
    assert "states jump before row 251: if these are several runs" in " ".join(
        out.split()
    )


def test_a_trajectory_in_milliseconds_with_decimal_commas_is_read(jblast):
    time, x, v = swings()[0]
    text = columns_of(1e3 * time, x, v, header="time_ms,x_m,v_m_s")
    german = text.replace(",", ";").replace(".", ",")
    code, out, _ = discovered(jblast, german, "--json")
    terms = json.loads(out)["equations"]["v_m_s"]["terms"]
    found = {term["term"]: term["coefficient"] for term in terms}
    assert code == 0
    assert found == pytest.approx({"x_m": -4.0, "v_m_s": -0.4}, rel=0.02)


ROWS = [f"{0.1 * i:g},{np.sin(0.3 * i):.6f},1.5" for i in range(30)]


# the fourth row, or a slash and a whole table; then options
REFUSED = table("""
0.3,1,1.5; => column y: expected values that change
0.3,1,1.5;--state z => line 1: missing column 'z'
0.3,1,1.5;--input w => which --input names
0.3,1,1.5;--state x --input x => got x twice
0.3,1,1.5;--state time_s => another column than time_s
0.3,1,1.5;--input x,y => a column that is no input
0.2,1,1.5; => line 5, column time_s: expected times that rise
0.3,nan,1.5; => line 5, column x: expected a number
0.3,1e200,1.5; => between -1e100 and 1e100, got 1e+200
0.3,,1.5; => line 5, column x: expected a number
0.3,1; => line 5: expected 3 fields
/time_s,x / 0,1 / 1,2; => at least 20 rows after the header, got 2
/t,x / 0,1; => line 1: expected one column time_s, got t, x
/time_s,x,x / 0,1,1; => 'x' once, got it twice
/; => got an empty file
0.3,1,1.5;--state x --threshold 2 => --threshold
0.3,1,1.5;--state x --degree 0 => --degree
0.3,1,1.5;--state x --ensemble 18 => from 19 to 10000
""")


@pytest.mark.parametrize(("asked", "said"), REFUSED)
def test_bad_input_is_one_message(jblast, asked, said):
    row, _, options = asked.partition(";")
    lines = row[1:].split(" / ")
    if row[0] != "/":
        lines = ["time_s,x,y", *ROWS[:3], row, *ROWS[4:]]
    content = "\n".join(lines) + "\n" if lines != [""] else ""
    path = jblast.file("flight.csv", content)
    says(jblast.refused("discover", path, *options.split()), said)
