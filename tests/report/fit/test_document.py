"""What `--json` prints, key by key: the contract is with programs."""

from dataclasses import replace

from jblast.inference.fitting.findings import WrongClock, WrongSensor
from jblast.report.fit.document import fit_document
from tests.report import example

NOTHING = dict.fromkeys(("value", "sd", "log_sd", "q05", "q50", "q95")) | {
    "identified": False
}


def test_what_is_not_identified_is_null_and_every_key_is_there():
    document = fit_document(example.not_identifiable())
    assert document["estimates"].pop("origin_time_s")["log_sd"] is None
    assert list(document.items()) == [
        ("schema", 1),
        ("law", {"air_arrival_s": "wu_hao"}),
        ("law_reason", {"air_arrival_s": "requested"}),
        ("law_valid", True),
        ("law_valid_rows", 12),
        (
            "estimates",
            {"charge_mass_kg": NOTHING, "air_sound_speed_m_s": NOTHING},
        ),
        ("derived", {"charge_energy_j": NOTHING}),
        ("free", ["charge_mass_kg", "air_sound_speed_m_s", "origin_time_s"]),
        ("identifiable", False),
        (
            "null_directions",
            [
                {
                    "parameters": {"charge_mass_kg": 1.0, "air_sound_speed_m_s": -0.2},
                    "space": "ln",
                    "cure": "a prior on, or a measurement of, charge_mass_kg or "
                    "air_sound_speed_m_s; or a peak overpressure at a new range",
                }
            ],
        ),
        ("ambiguities", []),
        (
            "determined",
            [
                {
                    "combination": "0.2 ln charge_mass_kg + ln air_sound_speed_m_s",
                    "value": 6.37128,
                    "sd": 0.0051,
                }
            ],
        ),
        ("posterior", "laplace"),
        ("converged", True),
        ("chi2", 9.1),
        ("dof", 6),
        ("n_observations", 8),
        ("n_lower_bounds", 0),
        ("suspected_outliers", []),
        ("explained_by", []),
        ("warnings", []),
        ("assumptions", []),
        ("extrapolated", []),
        ("understood", []),
        ("place", None),
        ("origin_time_utc", None),
        ("origin_clock", ""),
        (
            "charges_on_earth",
            [{"charge": "", "place": None, "origin_time_utc": None}],
        ),
    ]


def test_a_wrong_clock_has_an_offset_and_a_wrong_sensor_none():
    rest = (2.5, 3, 0.47, 4, {"origin_time_s": example.Estimate()})
    wrong = (
        WrongClock("c", *rest, -0.8, 0.01, "clock_offset_s.c"),
        WrongSensor("d", *rest),
    )
    fit = example.three_parameters()
    fit = replace(fit, summary=replace(fit.summary, explained_by=wrong))
    clock, sensor = fit_document(fit)["explained_by"]
    said = {
        "chi2": 2.5,
        "dof": 3,
        "p_value": 0.47,
        "law_valid_rows": 4,
        "estimates": {"origin_time_s": NOTHING},
    }
    offset = {"offset_s": -0.8, "offset_sd": 0.01, "parameter": "clock_offset_s.c"}
    first = {"kind": "clock", "name": "c"}
    assert list(clock.items()) == list((first | offset | said).items())
    first = {"kind": "sensor", "name": "d"}
    assert list(sensor.items()) == list((first | said).items())
