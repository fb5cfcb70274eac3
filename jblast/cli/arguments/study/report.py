"""A report on a study's store by a command."""

import argparse
import sys
from pathlib import Path


def report(asked: argparse.Namespace) -> int:
    """Report on a store; return the exit code.

    Raises:
        InputError: There is not one store, it is of another kind or keeps no samples,
            or what is to be written is there.
    """
    import json

    from jblast.errors import InputError
    from jblast.report.fit.files import check_directory
    from jblast.report.study_page import study_report
    from jblast.report.study_stores import read_columns

    stores = asked.given[1:]
    if len(stores) != 1:
        raise InputError(f"report: expected one store, got {len(stores)}")
    out = Path(asked.out) if asked.out else None
    if out is not None:
        check_directory(out, asked.force)
    store = Path(stores[0])
    found = study_report(read_columns(str(store)), store.name)
    if out is not None:
        from jblast.cli.arguments.paths import writing
        from jblast.report.study_page import write_report

        with writing(out):
            write_report(found, out)
    if asked.json:
        text = json.dumps(found.document(), indent=2, allow_nan=False)
        sys.stdout.write(text + "\n")
    else:
        sys.stdout.write(found.text())
        if out is not None:
            sys.stdout.write(f"Written: {out / 'report.html'}\n")
    return 0
