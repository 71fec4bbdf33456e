"""The choice of the method in the method panel, and what it switches off."""

from __future__ import annotations

import pytest

from slideviz.session import changes

pytestmark = [pytest.mark.usefixtures("unpainted"), pytest.mark.window("shared")]

REDUCTION = ("selection", "levels", "level_end", "gamma")


@pytest.fixture
def ready(driver, sample_folder):
    """The case of the passage, which can run, and its method panel."""
    driver.open(sample_folder / "passage" / "passage.cfg")
    driver.window.docks["method"].raise_()
    return driver


def test_what_the_method_does_not_use_is_disabled_says_so_and_comes_back(ready):
    panel, more = ready.window.method, ready.window.method.more
    ready.click(more.button)
    fields = [panel.reduction, more.kernel, more.influence_factor]
    assert ready.session.case.method == "rbf"
    assert all(field.isEnabled() for field in fields)
    for value, words in (("idw", "inverse distance weighting"), ("elastic", "linear elasticity")):
        ready.choose(panel.method, value)
        assert ready.session.case.method == value
        for field in [*fields, *(getattr(more, name) for name in REDUCTION)]:
            assert not field.isEnabled()
            assert f"{words} does not use it" in field.toolTip()
        for field in (panel.steps, panel.sliding, more.feature_angle_deg, more.quality_metric):
            assert field.isEnabled()
    ready.choose(panel.method, "rbf")
    assert all(field.isEnabled() for field in fields)
    assert "does not use it" not in more.kernel.toolTip()
    panel = ready.window.method
    ready.choose(panel.reduction, "YES")
    ready.type(panel.tolerance, "0.002")
    ready.choose(panel.method, "elastic")
    assert not panel.tolerance.isEnabled()
    ready.choose(panel.method, "rbf")
    assert panel.tolerance.isEnabled()
    assert ready.session.case.reduction.tolerance == 0.002


@pytest.mark.parametrize("value", ["idw", "elastic"])
def test_a_run_with_the_method_shows_its_quality(ready, value):
    ready.choose(ready.window.method.method, value)
    ready.window.store.change(changes.set_case, steps=2)
    ready.click(ready.window.run_panel.run)
    ready.settle()
    assert len(ready.session.frames) == 3
    assert ready.session.deformed.quality.inverted == 0
    assert f"{ready.session.deformed.quality.min:.4f}" in ready.window.player.result.text()
