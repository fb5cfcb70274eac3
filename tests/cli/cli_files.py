"""Files the tests of the command line hand to it, and how they call it."""

import sys
from pathlib import Path

from jblast.cli.main import main
from jblast.errors import MARK

JBLAST = (sys.executable, "-m", "jblast.cli.main")
"""The command as a process of its own."""
HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"
TWO = f"""{HEADER}a,air_arrival_s,0.05,0.001,30,0,1
b,peak_overpressure_pa,20000,1000,40,0,1
"""
SENSORS = """
[[sensor]]
name = "a"
position_m = [30.0, 0.0, 1.0]
records = { air_arrival_s = 1e-4, peak_overpressure_pa = "5%" }
[[sensor]]
name = "b"
position_m = [0.0, 60.0, 1.0]
records = { peak_overpressure_pa = "5%", positive_impulse_pa_s = "5%" }
"""


def table(text: str) -> list[tuple[str, str]]:
    """Return what is given and what is said of it, a line each: `given => said`."""
    rows = (line.partition(" => ") for line in text.strip("\n").splitlines())
    return [(given, said) for given, _, said in rows]


def says(message: str, said: str) -> None:
    """Assert that a message is one line and has all parts, which bars are between."""
    assert message.count("\n") == 1, message
    assert all(part in message for part in said.split(" | ")), message


class Command:
    """Runs jblast in a directory of its own, and reads what it said."""

    def __init__(self, directory: Path, capsys):
        self.directory, self.capsys = directory, capsys

    def file(self, name: str, content: str | bytes) -> str:
        path = self.directory / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(path)

    def path(self, name: str) -> str:
        return str(self.directory / name)

    def text(self, name: str) -> str:
        return (self.directory / name).read_text(encoding="utf-8")

    def __call__(self, *arguments: str) -> tuple[int, str, str]:
        """Return exit code, stdout, stderr."""
        self.capsys.readouterr()
        try:
            code = main(list(arguments), progress=False)
        except SystemExit as left:  # argparse
            code = left.code if isinstance(left.code, int) else 1
        said = self.capsys.readouterr()
        assert MARK not in said.out + said.err, "the mark of an argument is printed"
        return code, said.out, said.err

    def refused(self, *arguments: str) -> str:
        """Return the one message of a command that has to exit 2."""
        code, out, err = self(*arguments)
        assert code == 2, (code, err)
        assert out == ""
        assert "Traceback" not in err
        return err
