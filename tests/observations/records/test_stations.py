"""Tables of where recorders stood."""

import json
from datetime import UTC, datetime

import pytest

from jblast.errors import InputError
from jblast.observations.records.stations import Station, read_stations

TABLE = """# a campaign
sensor,note,east_m,north_m,up_m,clock
gate,tripod,1.5,-2,0.5,phone
"mast.1",top,0,0,10,
"""


def table(tmp_path, text):
    path = tmp_path / "stations.csv"
    path.write_text(text)
    return path


def test_places_and_clocks_are_read(tmp_path):
    stations = read_stations(table(tmp_path, TABLE))
    assert list(stations) == ["gate", "mast.1"]
    assert stations["gate"] == Station((1.5, -2.0, 0.5), "phone")
    assert stations["mast.1"].clock == ""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "",
            "is empty; expected a table of stations: a header sensor,east_m,north_m,up",
        ),
        (
            TABLE.replace("1.5", "inf"),
            "line 3, column east_m: expected a finite number",
        ),
        (TABLE.replace("gate", ""), "column sensor: expected a new name, got nothing"),
        (TABLE.replace("up_m", "north_m"), "column north_m once, got 'north_m' and"),
        (TABLE.replace("clock", "watch"), "unknown column 'watch'"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        read_stations(table(tmp_path, text))


def test_stations_in_feet_and_with_decimal_commas_are_metres(tmp_path):
    understood = []
    text = "Sensor;East (ft);north_ft;up_m\ngate;10,5;-20,25;1,5\n"
    (gate,) = read_stations(table(tmp_path, text), understood).values()
    assert gate.position == pytest.approx((10.5 * 0.3048, -20.25 * 0.3048, 1.5))
    assert len(understood) == 4  # semicolons, commas, feet twice


def test_a_station_may_tell_when_its_record_began(tmp_path):
    text = (
        "sensor,east_m,north_m,up_m,start_utc\n"
        "a,1,2,3,2020-08-04T18:08:18.310001+03:00\nb,1,2,3,\n"
    )
    stations = read_stations(table(tmp_path, text))
    # 18:08:18 at +03:00, in seconds since 1970 by `date -d`
    assert stations["a"].start == datetime.fromtimestamp(1596553698.310001, UTC)
    assert stations["b"].start is None
    unzoned = text.replace("+03:00", "")
    with pytest.raises(InputError, match="line 2, column start_utc: expected a day, a"):
        read_stations(table(tmp_path, unzoned))


def test_places_in_degrees_are_metres_about_their_middle(tmp_path):
    text = "sensor,lat_deg,lon_deg,alt_m\na,33.9,35.5,10\nb,33.902,35.5,20\n"
    stations = read_stations(table(tmp_path, text))
    # a degree of latitude is 110.92 km there
    assert stations["b"].position == pytest.approx((0, 110.92, 5), abs=0.01)
    assert stations["a"].frame == stations["b"].frame
    mixed = text.replace("lon_deg,alt_m", "east_m,north_m")
    with pytest.raises(InputError, match="missing column lon_deg"):
        read_stations(table(tmp_path, mixed))


def test_all_faults_of_a_table_are_in_one_message(tmp_path):
    text = (
        "sensor,lat_deg,lon_deg,alt_m,start_utc\na,52.37128,4.9,x,\n"
        "a,95.0,4.9,1,yesterday\n,52.37,4.9,1,\n"
    )
    with pytest.raises(InputError) as raised:
        read_stations(table(tmp_path, text))
    message = str(raised.value)
    assert "stations.csv: 5 faults: line 3, column sensor: expected a new" in message
    for said in (
        "line 4, column sensor: expected a new name, got nothing",
        "line 3, column lat_deg: expected a number between -90 and 90, got 95.0",
        "line 2, column alt_m: expected a finite number, got 'x'",
        "line 3, column start_utc: expected a day, a time and a zone",
    ):
        assert said in message
    text = "sensor,lat_deg,lon_deg,alt_m\na,,,\n"
    with pytest.raises(InputError, match="column lat_deg: expected a number, got no"):
        read_stations(table(tmp_path, text))
    text = "sensor,east_m,north,up_m,foo\na,1,2,3,4\n"
    with pytest.raises(
        InputError, match=r"column 'north'.*column 'foo'.*missing column n"
    ):
        read_stations(table(tmp_path, text))


KML = """<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}
</Document></kml>"""
MARK = """<Placemark><name>{}</name><Point><coordinates>{}</coordinates></Point>
</Placemark>"""


def test_points_of_kml_and_geojson_are_stations(tmp_path):
    kml, geojson = tmp_path / "stations.kml", tmp_path / "stations.geojson"
    places = {"A": "11.50,48.20,500", "B": "11.51,48.21,500"}
    marks = "".join(MARK.format(*pair) for pair in places.items())
    kml.write_text(KML.format(marks))
    text = "sensor,lat_deg,lon_deg,alt_m\nA,48.20,11.50,500\nB,48.21,11.51,500\n"
    expected = read_stations(table(tmp_path, text))
    assert read_stations(kml) == expected
    features = [
        {"properties": {"name": name}, "geometry": {"type": "Point", "coordinates": at}}
        for name, at in (("A", [11.5, 48.2, 500]), ("B", [11.51, 48.21, 500]))
    ]
    geojson.write_text(json.dumps({"features": features}))
    assert read_stations(geojson) == expected
    # of a map that jblast wrote, the sensors
    charge = MARK.format("charge", "11.6,48.2")
    ours = f"<Folder><name>Sensors</name>{marks}</Folder>{charge}"
    kml.write_text(KML.format(ours))
    assert read_stations(kml) == expected
    kml.write_text("<kml>")
    with pytest.raises(InputError, match=r"expected stations as \.kml"):
        read_stations(kml)


def test_station_xml_gives_positions_and_sensitivities():
    stations = read_stations("tests/data/counts_per_pa_station.xml")
    assert list(stations) == [f"XX.I{n}.01.BDF" for n in range(1, 5)]
    assert stations["XX.I1.01.BDF"].sensitivity == pytest.approx(1.6e-5)
