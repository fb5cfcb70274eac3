"""Reading a log needs neither JAX nor pandas."""

import subprocess
import sys


def test_a_text_is_read_and_worded_without_jax(tmp_path):
    (tmp_path / "log.csv").write_text(
        "sensor;quantity;value;sigma;lat_deg;lon_deg\n"
        "a;peak_overpressure_kpa;5,5;;48,2;11,5\n"
    )
    program = (
        "import sys, jblast.observations as o\n"
        "log = o.read('log.csv')\n"
        "from jblast.report.messages import sentences_of\n"
        "assert sentences_of(log.understood)\n"
        "print({'jax', 'pandas', 'equinox'} & set(sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "set()\n"
