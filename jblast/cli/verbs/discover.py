"""Identify the equations of motion of a trajectory, with the uncertainty of each term.

Exit code 4: no law is found; terms beyond the search explain the residual, or the
record is too short to test this; the integrated equations do not reproduce the data; or
nearly collinear terms are exchangeable. Except in the last case, products of one more
column are tried then.

example:
  jblast discover flight.csv --input push_m_s2 --drag

input:
  TRAJECTORY.csv      path; text with a header: time_s and numeric columns, one row a
                      time; a column run numbers several runs
  --state COLUMN,...  names; columns to find equations for (default: all but time_s and
                      the inputs)
  --input COLUMN,...  names; driving columns, such as a wind or a command, without
                      errors (default: none)
  --held              inputs that are constant until the next row, as commands are
                      (default: linear between rows)
model:
  --degree N          integer = 2; largest number of columns in a product
  --drag              additional candidates |x| x for each column x
output:
  --out DIR           path; folder for discover.json, discover.png and report.html
  ...out
advanced:
  --threshold SHARE   share = 0.05; smallest contribution of a term, as a share of the
                      derivative's root mean square
  --ensemble N        integer = 100; number of records with new noise, for the
                      uncertainty of the terms, at least 19
  --seed N            seed = 0; seed of the noise
"""

import argparse

from jblast.files import check_out


def run(options: argparse.Namespace) -> int:
    """Find, write, print; return the exit code."""
    from jblast.discovery.law_search import check_search, discover_law

    # checked before the output folder is made
    check_search(degree=options.degree, members=options.ensemble)
    if options.out:
        names = ("discover.json", "discover.png")
        check_out(options.out, names, force=options.force)
    search = discover_law(
        options.trajectory,
        states=options.state or (),
        inputs=options.input or (),
        held=options.held,
        degree=options.degree,
        drag=options.drag,
        threshold=options.threshold,
        members=options.ensemble,
        seed=options.seed,
    )
    # imported after the search, so that a wrong file is reported without this wait
    from jblast.report.discovery import discovery_answer
    from jblast.report.output import deliver

    return deliver(discovery_answer(search), options, folder=options.out)
