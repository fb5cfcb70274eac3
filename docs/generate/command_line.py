"""The command line as its parsers tell it."""

import argparse

from jblast.cli.main import parser


def verbs() -> str:
    """Write a section for each verb: what it does, how it is typed, what it takes."""
    root = parser()
    (choices,) = (
        action.choices
        for action in root._actions
        if isinstance(action, argparse._SubParsersAction)
    )
    return "\n\n".join(_verb(name, verb) for name, verb in choices.items())


def _verb(name: str, verb: argparse.ArgumentParser) -> str:
    formatter = verb._get_formatter()
    rows = [
        f"| {_named(action)} | {_cell(formatter._expand_help(action))} |"
        for action in verb._actions
        if action.help is not argparse.SUPPRESS
    ]
    usage = verb.format_usage().removeprefix("usage: ").rstrip()
    return "\n".join(
        [
            f"## jblast {name}",
            "",
            _prose(verb.description or ""),
            "",
            f"```text\n{usage}\n```",
            "",
            "| | |",
            "|---|---|",
            *rows,
        ]
    )


def _named(action: argparse.Action) -> str:
    """Return how an argument is written: `--law NAME`, `SCENE.toml`."""
    value = action.metavar or ""
    if action.choices is not None and not value:
        value = "{" + ",".join(map(str, action.choices)) + "}"
    if isinstance(value, tuple):
        value = " ".join(value)
    if not action.option_strings:
        return f"`{value or action.dest}`"
    if action.nargs == 0:
        value = ""
    elif not value:
        value = action.dest.upper()
    return _cell(
        ", ".join(f"`{f'{o} {value}'.strip()}`" for o in action.option_strings)
    )


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


def _prose(text: str) -> str:
    """Return a docstring as paragraphs, indented lines as code."""
    return text.replace("<", "&lt;").strip()
