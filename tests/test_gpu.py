"""``make gpu``: what it prints with a card and without."""

from __future__ import annotations

from tests.fake_cupy import fake_cupy, needs_compiler
from tools import gpu

__all__ = ["fake_cupy"]


def test_without_a_card_it_says_so_in_a_line(fake_cupy, capsys):
    fake_cupy(count=0)
    assert gpu.main([]) == 0
    assert capsys.readouterr().out == (
        "gpu: nothing is measured: this machine has no card of NVIDIA; use another machine\n"
    )


@needs_compiler
def test_each_row_has_speed_and_error(fake_cupy, capsys, monkeypatch):
    fake_cupy()
    assert gpu.main(["--targets", "3000", "--controls", "40"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0].startswith("Fake, 2 GiB, and ")
    assert len(out) == 3 + len(gpu.rows(1000, 10))
    monkeypatch.setattr(gpu, "MOST", -1.0)
    assert gpu.main(["--targets", "3000", "--controls", "40"]) == 1
