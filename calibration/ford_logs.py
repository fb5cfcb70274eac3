"""Write two shots of the Ford 2021 set as logs and scenes for `jblast fit`.

    python -m calibration.ford_logs

HTA-1 stood 4.8 m above soft rock, HRI-2 3 m, in another campaign. The table has no
instrument errors, so sigma stays empty: the law's own scatter is all there is.
"""

import csv
from pathlib import Path

DATA = Path(__file__).parent / "data"
SHOTS = ("HTA-1", "HRI-2")


def rows_of(shot: str) -> list[dict[str, str]]:
    """Return the records of one shot as the table has them."""
    with (DATA / "acoustic_ford2021.csv").open(encoding="utf-8") as lines:
        table = csv.DictReader(line for line in lines if not line.startswith("#"))
        return [row for row in table if row["source"] == shot]


def log(shot: str) -> str:
    """Return a shot as an observation file."""
    lines = [
        f"# shot {shot} of S.R. Ford et al. 2021 (LLNL), from acoustic_ford2021.csv "
        "beside this file, where its provenance stands",
        "sensor,quantity,value,sigma,range_m,path",
    ]
    for row in rows_of(shot):
        for column, quantity in (
            ("impulse_Pa_s", "positive_impulse_pa_s"),
            ("duration_s", "positive_duration_s"),
        ):
            lines.append(
                f"{row['station']},{quantity},{row[column]},,{row['range_m']},"
                f"{row['path']}"
            )
    return "\n".join(lines) + "\n"


def scene(shot: str) -> str:
    """Return what is known of a shot beside its mass, as a scene file."""
    row = rows_of(shot)[0]
    return (
        f"# Shot {shot}: what the table says of it, its mass withheld.\n"
        "[charge]\n"
        'mass_kg = "free"\n'
        f"position_m = [0.0, 0.0, {row['hob_m']}] # the height of burst\n\n"
        "[air]\n"
        f"temperature_k = {row['T_ambient_K']}\n"
        f"pressure_pa = {1e3 * float(row['P_ambient_kPa'])!r}\n"
        "relative_humidity = 0.0 # not recorded; the law was calibrated with dry air\n"
    )


def main() -> None:
    """Write a log and a scene for each of `SHOTS`."""
    for shot in SHOTS:
        name = shot.lower().replace("-", "_")
        (DATA / f"{name}.csv").write_text(log(shot), encoding="utf-8")
        (DATA / f"{name}.toml").write_text(scene(shot), encoding="utf-8")
        print(f"wrote {name}.csv and {name}.toml")


if __name__ == "__main__":
    main()
