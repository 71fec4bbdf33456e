"""Tables in TOML files beside the modules that use them."""

import tomllib
from pathlib import Path
from typing import Any


def table_beside(module: str) -> dict[str, Any]:
    """Return the content of the TOML file that has the name of a module's file, ``module``."""
    return tomllib.loads(Path(module).with_suffix(".toml").read_text(encoding="utf-8"))
