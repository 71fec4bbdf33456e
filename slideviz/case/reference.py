"""The text of ``slideviz keys``: every key with its values, default and meaning."""

from __future__ import annotations

import textwrap

from slideviz.case.key import GROUPS
from slideviz.case.keys import KEYS


def describe_keys() -> str:
    """Return the reference of all keys, under headings, each with values, default and meaning."""
    lines = [
        "Keys of a case file: KEY= value, one in each line, in any order.",
        "",
        *textwrap.wrap(
            "Comments begin with %, # or $. A line that ends with a backslash goes on in the "
            "next. Paths are relative to the file. Names with other signs than letters, digits "
            'and _ . - : / @ + stand between double quotes: "tip #2". NONE or ( ) is an empty '
            "list. Keys marked + are slideviz's own, the others are RBF-SliDe's too.",
            width=90,
        ),
    ]
    for group in GROUPS:
        lines += ["", group.upper()]
        for key in KEYS.values():
            if key.group == group:
                mark = " " if key.rbf_slide else "+"
                lines.append(f"{mark} {key.name}= {key.kind.allowed}   [{key.default}]")
                lines += textwrap.wrap(
                    key.meaning, 90, initial_indent="      ", subsequent_indent="      "
                )
                lines += [f"        {line}" for line in key.kind.details]
    return "\n".join(lines)
