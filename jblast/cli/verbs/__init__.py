"""Verbs of the command line.

A verb is a module: its docstring has its help and its options (`jblast.cli.spec`), and
`run` returns the exit code. It is imported when it is typed, so that JAX, NumPy and
Matplotlib are imported inside functions only. `PROGRESS = False` turns the progress
line off.
"""

import re

LIST = """\
main path: from handbook laws, readings or pressure records to a blast
  calc       calculate a blast by every law, or the range or mass for a value
  check      list all errors and warnings of a log before a fit
  fit        fit a blast to a log of sensor readings, or to pressure records
  pick       pick blasts from pressure records and write a log

logs: conversion of a log, and a scene file for it
  convert    convert a log with other columns and units
  scene      write a commented scene file for a log

analysis: other recordings, trajectories, and sensor layouts
  detect     detect a blast in sound, film or camera events
  tune       estimate sensor and medium parameters from a recording, or tune a
             vehicle's gains
  bound      predict the uncertainty of a fit for a planned sensor layout
  discover   identify the equations of motion of a trajectory

simulation: readings, recordings, worlds of blasts and Monte Carlo studies
  simulate   simulate the readings of a scene's sensors
  listen     simulate recordings over time: sound, pressure, wind, ground
             motion
  world      simulate random blasts as all sensors of a scene record them
  report     write an HTML page for a run of `jblast world`
  serve      serve a world of blasts to other simulators and autopilots
  study      run a Monte Carlo study of a scene

film: images and camera events
  render     render a scene's blast: frames and camera events
  events     convert frames to the events of an event camera

flight: vehicles and their missions
  fly        fly a scene's vehicle through its blasts: path error and recovery
  plan       write a mission plan: lanes over a field, or a circle

methods: cost, accuracy and limits of the methods
  choose     name the most accurate law for a scene, within a tolerance
"""
"""The verbs by group, as the help lists them; a new verb is one line."""


def names_in(text: str) -> list[str]:
    """Return the names of the verbs in a part of `LIST`."""
    return re.findall(r"^ {2}(\w+)", text, re.M)


VERBS = tuple(names_in(LIST))
