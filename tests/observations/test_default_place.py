"""A sensor where the default scene has the charge."""

import pytest

from jblast.cli.arguments.options import in_options
from jblast.errors import InputError
from jblast.observations import read, resolve_positions
from jblast.scene import Scene

HEADER = "sensor,quantity,value,sigma,east_m,north_m,up_m\n"


@pytest.mark.parametrize(
    ("row", "names"),
    [
        ("air_arrival_s,1.4,.001", "charge_east_m,charge_north_m,origin_time_s"),
        ("peak_overpressure_pa,5e3,100", "charge_east_m,charge_north_m"),
    ],
)
def test_a_sensor_at_the_origin_is_told_what_to_free_without_a_scene(
    tmp_path, row, names
):
    path = tmp_path / "log.csv"
    path.write_text(f"{HEADER}a,{row},0,0,0\nb,{row},150,0,0\n")
    log = read(path)
    with pytest.raises(InputError) as refused:
        resolve_positions(log, Scene(), {"charge_mass_kg"}, is_default=True)
    message = str(in_options(refused.value))
    assert "line 2: sensor 'a' stands at [0, 0, 0] m; no scene given: " in message
    assert message.endswith(f"the charge is assumed at the origin; add --free {names}")
    with pytest.raises(InputError, match="where the charge is; expected a distance"):
        resolve_positions(log, Scene(), {"charge_mass_kg"})
