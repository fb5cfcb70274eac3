"""A log of Student-t errors that has two optima: the worse ends a fit, or starts it."""

import numpy as np
import pytest

from jblast.inference import fit_many
from jblast.scene import read_scene
from jblast.sensors import planned_layout

SENSOR = """
[[sensor]]
name = "m{n}"
position_m = [{east}, 0.0, 0.0]
records = {{ air_arrival_s = 2e-4, peak_overpressure_pa = "20%" }}
"""
SCENE = """
[charge]
mass_kg = "free"
position_m = [{ normal = [0.0, 5.0] }, { normal = [0.0, 5.0] }, 0.0]
time_s = { normal = [0.0, 0.1] }
[air]
temperature_k = { normal = [288.0, 3.0] }
[law]
scatter = false
air_arrival_s = "kingery_bulmash"
peak_overpressure_pa = "kingery_bulmash"
""" + "".join(SENSOR.format(n=n, east=20.0 * n) for n in range(1, 7))
LAWS = {"air_arrival_s": "kingery_bulmash", "peak_overpressure_pa": "kingery_bulmash"}
# Of 100 kg in a line of sensors, one of 384 that were drawn. Times, then pressures.
TIMES_S = (
    *(0.18114950713937522, 0.2340108233116311, 0.2897074714221626),
    *(0.3460141156118789, 0.40376688519010495, 0.46132491525986263),
)
PRESSURES_PA = (
    *(25587.641579829928, 9951.546529732526, 3877.6129866348124),
    *(5912.701382619683, 2277.3778013392775, 5139.237365541541),
)


@pytest.mark.slow
def test_a_fit_that_starts_again_sooner_finds_the_better_optimum(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    uncertain = read_scene(tmp_path / "scene.toml")
    layout, sigma, _ = planned_layout(uncertain.scene)
    readings = np.ravel(np.column_stack([TIMES_S, PRESSURES_PA]))[None]
    assert layout.quantity[:2] == ("air_arrival_s", "peak_overpressure_pa")
    given = (uncertain, layout, readings, np.asarray(sigma), LAWS)
    own = fit_many(*given)
    # the first start is on the line of sensors, where the cost is level across it; the
    # coordinates are ln of the mass, then east, north, time and temperature in sd
    starts = [[[4.2, 0.0, 0.0, 0.0, 0.0]], [[4.2, -1.0, 1.5, 1.3, 1.0]]]
    late, soon = (
        fit_many(*given, starts=np.array(starts), again_z=z) for z in (6.0, 2.0)
    )
    for found in (own, late, soon):
        assert found.converged.all()
        assert found.values["charge_mass_kg"][0] > 50
    assert soon.cost[0] < late.cost[0] - 2
    np.testing.assert_allclose(own.cost, soon.cost, rtol=1e-9)
