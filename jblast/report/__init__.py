"""What we print: the answer in words, its figures, and one page with all of it."""

from jblast.report.text import summary as summary
from jblast.report.write import (
    check_directory as check_directory,
    plain as plain,
    write_report as write_report,
)
