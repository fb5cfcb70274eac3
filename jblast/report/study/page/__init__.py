"""A study as one page: tables, curves, contours, and what scatter comes from."""

from jblast.report.study.page.page import (
    StudyReport as StudyReport,
    study_report as study_report,
)
