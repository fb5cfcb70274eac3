"""What the page of the calculator prints, and its Python."""

import re
from pathlib import Path

import numpy as np

from jblast.cli.main import main
from jblast.report.calculator.terminal import calculation_text
from jblast.scene import Air, Scene
from jblast.sensors.calculator import Question, calculate

CALCULATOR_PAGE = (Path(__file__).parents[5] / "docs/howto/calculate.md").read_text(
    encoding="utf-8"
)
DRY = Scene(air=Air(relative_humidity=0.0))


def test_what_the_manual_prints_is_what_the_calculator_says(capsys):
    forward = Question(DRY, (20.0,), (15.0,))
    answer = calculate(DRY, *forward.rows())
    commands, *blocks = re.findall(r"^```\n(.*?)^```", CALCULATOR_PAGE, re.M | re.S)
    assert "--mass 15 --range 20" in commands
    assert "--mass 15 --overpressure 5kPa" in commands
    printed = []
    for words in (["--range", "20"], ["--overpressure", "5kPa"]):
        assert main(["calc", "--mass", "15", *words]) == 0
        printed.append(capsys.readouterr().out)
    printed.insert(1, calculation_text(forward, answer, None))
    for block, text in zip(blocks, printed, strict=True):
        for line in filter(lambda line: line.strip() != "...", block.splitlines()):
            start = line.removesuffix("...")
            assert any(said.startswith(start) for said in text.splitlines()), line


def test_the_python_in_the_manual_runs():
    (code,) = re.findall(r"^```python\n(.*?)^```", CALCULATOR_PAGE, re.M | re.S)
    names: dict = {}
    exec(code, names)
    rise = np.gradient(names["pressures"], names["ranges"])
    np.testing.assert_allclose(names["slopes"][1:-1], rise[1:-1], rtol=1e-3)
