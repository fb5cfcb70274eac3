"""The rows of a log: their fields, their units, and what each column must hold."""

from jblast.observations.rows.rows import AT_LEAST as AT_LEAST, Rows as Rows
