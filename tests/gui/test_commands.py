"""The table of commands: complete, in words, and no key twice."""

import re

import pytest
from qtpy.QtGui import QKeySequence

from slideviz.gui.commands import COMMANDS, MENUS, CommandState
from slideviz.gui.widgets.theme import NAMES
from slideviz.session import changes
from slideviz.session.state import Session
from slideviz.terms import SHOWN

EVERY = [one for menu in MENUS for one in menu.commands()]


def test_no_name_and_no_key_stands_for_two_commands(qtbot):
    assert len(COMMANDS) == len(EVERY)
    keys = [QKeySequence(keys).toString() for one in EVERY for keys in (*one.keys, one.button_key)]
    keys = [text for text in keys if text]
    assert len(set(keys)) == len(keys)


def test_the_tip_of_a_button_names_the_key_there_is():
    tips = {one.name: (re.search(r"\((.+)\)", one.button_tip), one) for one in EVERY}
    named = {name: (found[1], one) for name, (found, one) in tips.items() if found}
    assert {"step_next", "fit_colors", "cancel"} <= set(named)
    for key, one in named.values():
        assert key in (*one.keys, one.button_key), one.name


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.name)
def test_each_command_says_what_it_does_and_has_the_icon_it_names(one):
    assert one.tip.endswith(".")
    assert len(one.tip.split()) >= 3
    assert one.image in {"", *NAMES}
    assert one.called(CommandState(Session()))


@pytest.mark.parametrize("name", SHOWN)
def test_each_toggle_of_the_view_is_a_command_that_says_whether_it_is_on(session, name):
    assert COMMANDS[name].checked(CommandState(session)) == SHOWN[name].at_first
    switched = changes.set_view(session, **{name: not SHOWN[name].at_first})
    assert COMMANDS[name].checked(CommandState(switched)) != SHOWN[name].at_first
    assert COMMANDS[name].enabled(CommandState(session)) == (not SHOWN[name].why_not)
    assert not COMMANDS[name].enabled(CommandState(Session()))
