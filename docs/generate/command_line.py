"""Reference of the command line, generated from its parsers."""

import argparse
from html import escape

from jblast.cli.parsers import GROUPS, VERBS, verb_parser


def verbs() -> str:
    """Return a section for each verb: description, example, usage and options."""
    groups = [
        f"- **{group}**, {subject}: "
        + ", ".join(f"[{v.name}](#jblast-{v.name})" for v in VERBS if v.group == group)
        for group, subject in GROUPS.items()
    ]
    return "\n\n".join(["\n".join(groups), *(_verb(verb) for verb in VERBS)])


def _verb(verb) -> str:
    parser = verb_parser(verb)
    formatter = parser._get_formatter()
    usage = parser.format_usage().removeprefix("usage: ").rstrip()
    text = escape(f"{parser.summary}\n\n{parser.details}".strip(), quote=False)
    example = f"Example: `{parser.example}`"
    parts = [f"## jblast {verb.name}", text, f"```text\n{usage}\n```", example]
    for group in parser._action_groups:
        rows = [
            f"| <code>{_cell(formatter._format_action_invocation(action))}</code> "
            f"| {_cell(formatter._expand_help(action))} |"
            for action in group._group_actions
            if action.help != argparse.SUPPRESS
        ]
        if rows:
            parts.append("\n".join([f"| {group.title} | |", "|---|---|", *rows]))
    return "\n\n".join(parts)


def _cell(text: str) -> str:
    """Return text for a table, where a bar would start the next cell."""
    return escape(" ".join(text.split()), quote=False).replace("|", "&#124;")
