"""Rare outcomes: probabilities far below what plain draws would ever meet."""

from jblast.study.rare.design_point import (
    DesignPoints as DesignPoints,
    design_points as design_points,
)
from jblast.study.rare.probability import (
    RareProbability as RareProbability,
    rare_probability as rare_probability,
)
