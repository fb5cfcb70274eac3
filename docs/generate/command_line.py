"""The command line as its parsers tell it."""

import argparse
from html import escape

from jblast.cli.parsers import GROUPS, VERBS, verb_parser


def verbs() -> str:
    """Write a section for each verb: what it does, how it is typed, what it takes."""
    groups = [
        f"- **{group}**, {meaning}: "
        + ", ".join(f"[{v.name}](#jblast-{v.name})" for v in VERBS if v.group == group)
        for group, meaning in GROUPS.items()
    ]
    sections = (_verb(verb.name, verb_parser(verb)) for verb in VERBS)
    return "\n\n".join(["\n".join(groups), *sections])


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
            "| word | what it does |",
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
        return _code(value or action.dest)
    if action.nargs == 0:
        value = ""
    elif not value:
        value = action.dest.upper()
    return ", ".join(_code(f"{option} {value}") for option in action.option_strings)


def _code(text: str) -> str:
    """Return text as code in a table, where backticks would show an escaped bar."""
    return f"<code>{escape(text.strip()).replace('|', '&#124;')}</code>"


def _cell(text: str) -> str:
    return escape(" ".join(text.split()), quote=False).replace("|", "&#124;")


def _prose(text: str) -> str:
    """Return a docstring as paragraphs."""
    return escape(text.strip(), quote=False)
