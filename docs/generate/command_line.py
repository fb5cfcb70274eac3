"""Reference of the command line, generated from its parsers."""

import argparse
from html import escape

from jblast.cli.arguments.verb_parser import VerbParser
from jblast.cli.parsers import GROUPS, VERBS, verb_parser


def verbs() -> str:
    """Return a section for each verb: description, example, usage and options."""
    groups = [
        f"- **{group}**, {subject}: "
        + ", ".join(f"[{v.name}](#jblast-{v.name})" for v in VERBS if v.group == group)
        for group, subject in GROUPS.items()
    ]
    sections = (_verb(verb.name, verb_parser(verb)) for verb in VERBS)
    return "\n\n".join(["\n".join(groups), *sections])


def _verb(name: str, verb: VerbParser) -> str:
    formatter = verb._get_formatter()
    tables = []
    for group in verb._action_groups:
        rows = [
            f"| {_named(action)} | {_cell(formatter._expand_help(action))} |"
            for action in group._group_actions
            if action.help is not argparse.SUPPRESS
        ]
        if rows:
            tables += ["", "\n".join([f"| {group.title} | |", "|---|---|", *rows])]
    usage = verb.format_usage().removeprefix("usage: ").rstrip()
    return "\n".join(
        [
            f"## jblast {name}",
            "",
            _prose(f"{verb.summary}\n\n{verb.details}"),
            "",
            f"```text\n{usage}\n```",
            "",
            f"Example: `{verb.example}`",
            *tables,
        ]
    )


def _named(action: argparse.Action) -> str:
    """Return an argument as it is typed: `--law NAME`, `SCENE.toml`."""
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
    """Return the paragraphs of a docstring."""
    return escape(text.strip(), quote=False)
