from tests.tools.counts import counts, lines_of


def test_lines_are_counted_by_kind():
    code = 'X = 1  # of it\n\n\ndef f():\n    """F."""\n    return os\n'
    text = f'"""Words."""\n\nimport os\n\n# reason\n{code}'
    assert lines_of(text) == (3, 1, 1, 2)


def test_a_function_that_occurs_once_besides_its_definition_is_counted(tmp_path):
    (tmp_path / "a.py").write_text("LIMIT = 2.0\n\n\ndef one():\n    return LIMIT\n")
    (tmp_path / "b.py").write_text("from a import one\n\nNAME = one()\n")
    found = counts(tmp_path)
    assert found["functions"] == "1"
    assert found["referenced once"] == "100.0%"
    assert found["numeric constants"] == "1"
