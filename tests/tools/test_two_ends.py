"""Two workers begin at the two ends of the list of files."""

from collections import OrderedDict
from typing import Any

import pytest

from tests.tools.two_ends import TwoEnds, pytest_xdist_make_scheduler

FILES = [f"tests/test_{letter}.py" for letter in "abcdef"]


class Worker:
    """Notes which of the collected tests it is sent."""

    def __init__(self):
        self.sent = []

    def send_runtest_some(self, indices):
        self.sent += indices


def test_every_other_worker_takes_files_from_the_end():
    scheduler: Any = object.__new__(TwoEnds)
    workers = [Worker(), Worker()]
    tests = [f"{file}::test_it" for file in FILES]
    scheduler.workqueue = OrderedDict(
        (file, {test: False}) for file, test in zip(FILES, tests, strict=True)
    )
    scheduler.assigned_work = {worker: {} for worker in workers}
    scheduler.registered_collections = dict.fromkeys(workers, tests)
    for _ in range(3):
        for worker in workers:
            scheduler._assign_work_unit(worker)
    assert [worker.sent for worker in workers] == [[0, 1, 2], [5, 4, 3]]
    assert not scheduler.workqueue


@pytest.mark.parametrize(
    ("dist", "first", "ends"),
    [("loadfile", "", True), ("loadfile", "tests/a", False), ("load", "", False)],
)
def test_only_whole_files_are_so_shared_and_not_where_some_come_first(
    dist, first, ends
):
    class Config:
        def getoption(self, name):
            return {"dist": dist, "first": first, "tx": ["2*popen"]}[name]

        getvalue = getoption
        rootpath = option = None

    config: Any = Config()
    made = pytest_xdist_make_scheduler(config, None)
    assert isinstance(made, TwoEnds) is ends
