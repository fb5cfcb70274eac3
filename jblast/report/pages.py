"""Pages of HTML from `templates`."""

from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined


def page(template: str, **values: Any) -> str:
    """Return a self-contained page.

    Args:
        template: Path of the template in this package; it may include others.
        **values: Variables of the template; a missing one is an error.
    """
    environment = Environment(
        # names from logs and scenes are escaped: they could contain markup
        autoescape=True,
        undefined=StrictUndefined,
        loader=FunctionLoader(_read),
    )
    return environment.get_template(template).render(**values)


def _read(name: str) -> str:
    return files("jblast.report").joinpath(name).read_text("utf-8")
