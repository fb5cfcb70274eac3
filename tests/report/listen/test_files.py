import numpy as np

from jblast.report.listen_files import file_names
from jblast.scene import Sensor


def test_every_sensor_has_a_file_of_its_own_whatever_it_is_called():
    called = ["a", "A", "truth", "../b", "c/d", "c_d", "...", "x" * 300, "Ö 1", "con\n"]
    sensors = [Sensor(name, np.zeros(3), "pressure") for name in called]
    names = file_names([*sensors, Sensor("phone", np.zeros(3), "microphone")])
    assert names == {
        "a": "a.csv",
        "A": "A_2.csv",
        "truth": "truth_2.csv",
        "../b": "_b.csv",
        "c/d": "c_d.csv",
        "c_d": "c_d_2.csv",
        "...": "_.csv",
        "x" * 300: "x" * 80 + ".csv",
        "Ö 1": "Ö 1.csv",
        "con\n": "con_.csv",
        "phone": "phone.wav",
    }
