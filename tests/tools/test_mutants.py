"""The list of mutants stays true while the files and tests it names change."""

import pytest

from tests.tools.mutants import ROOT, read


@pytest.mark.parametrize("mutant", read(), ids=lambda mutant: str(mutant.number))
def test_a_mutant_finds_its_token_and_the_test_that_killed_it(mutant):
    source = (ROOT / mutant.file).read_text()
    assert mutant.text[mutant.column :].startswith(mutant.old)
    assert mutant.applied(source) != source
    if "::" in mutant.killed_by:
        file, test = mutant.killed_by.split("::")[:2]
        assert f"def {test.split('[')[0]}(" in (ROOT / file).read_text()
