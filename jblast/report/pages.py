"""Pages of HTML from `templates`."""

from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined


def page(template: str, **values: Any) -> str:
    """Return a page that needs nothing beside it.

    Args:
        template: Its path in this package; it may include others.
        **values: What the template names; what it does not find is an error.
    """
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, loader=FunctionLoader(_read)
    )
    return environment.get_template(template).render(**values)


def _read(name: str) -> str:
    return files("jblast.report").joinpath(name).read_text("utf-8")
