"""Inputs made as small as they can be while they keep their fault."""

from __future__ import annotations

from collections.abc import Callable


def minimised(content: bytes, same: Callable[[bytes], bool], tries: int) -> bytes:
    """Return an input with the same fault, without lines, and then bytes, that it does not need.

    Delta debugging (Zeller and Hildebrandt, 2002): ever smaller parts are left out.
    ``same``: returns whether another input has the fault. ``tries``: most calls of it.
    """
    left = [tries]

    def still(other: bytes) -> bool:
        left[0] -= 1
        return left[0] >= 0 and same(other)

    lines = _without(content.splitlines(keepends=True), still)
    content = b"".join(lines)
    if len(content) < 4000:
        content = b"".join(_without([content[k : k + 1] for k in range(len(content))], still))
    return content


def _without(parts: list[bytes], still: Callable[[bytes], bool]) -> list[bytes]:
    size = len(parts) // 2
    while size:
        first = 0
        while first < len(parts):
            other = parts[:first] + parts[first + size :]
            if other and still(b"".join(other)):
                parts = other
            else:
                first += size
        size //= 2
    return parts
