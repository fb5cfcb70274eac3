"""What `--json` prints, key by key: the contract is with programs."""

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
        ("posterior", "weighted"),
        ("converged", True),
        ("chi2", 9.1),
        ("dof", 6),
        ("n_observations", 8),
        ("n_lower_bounds", 0),
        ("suspected_outliers", []),
        ("explained_by", []),
        (
            "problems",
            [
                "not identified: the recordings leave charge mass and air sound "
                "speed open"
            ],
        ),
        ("warnings", []),
        ("assumptions", []),
        ("extrapolated", []),
        ("understood", []),
        ("bearing_arcs", []),
        ("regions", []),
        ("unchecked", False),
        ("place", None),
        ("origin_time_utc", None),
        ("origin_clock", ""),
        (
            "charges_on_earth",
            [{"charge": "", "place": None, "origin_time_utc": None}],
        ),
    ]
