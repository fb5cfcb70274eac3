"""Reference of the command line, generated from its parsers."""

import argparse
import re
from html import escape

from jblast.cli.main import verb_parser
from jblast.cli.verbs import LIST, VERBS, names_in


def verbs() -> str:
    """Return a section for each verb: description, example, usage and options."""
    groups = [
        re.sub(r"^(.*?): (.*)", r"- **\1**, \2: ", head)
        + ", ".join(f"[{name}](#jblast-{name})" for name in names_in(text))
        for head, _, text in (part.partition("\n") for part in LIST.split("\n\n"))
    ]
    return "\n\n".join(["\n".join(groups), *(_verb(name) for name in VERBS)])


def _verb(name: str) -> str:
    parser = verb_parser(name)
    formatter = parser._get_formatter()
    usage = parser.format_usage().removeprefix("usage: ").rstrip()
    text = escape(f"{parser.summary}\n\n{parser.details}".strip(), quote=False)
    example = f"Example: `{parser.example}`"
    parts = [f"## jblast {name}", text, f"```text\n{usage}\n```", example]
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
