"""When to stop waiting: loops that go on until an error has fallen count how often it has not."""

from __future__ import annotations

FALL = 0.9
"""An error has fallen when it is below this part of what it was."""

LOSSES = 8
"""How often in a row an error may fail to fall."""


class Patience:
    """Ends the waiting for an error that does not fall, or that costs too much to lower.

    Attributes
    ----------
    budget : float
        What the waiting may cost in all, in the caller's unit.
    """

    def __init__(self, error: float, budget: float) -> None:
        self.budget = budget
        self._lowest, self._losses, self._spent = error, 0, 0.0

    def ends(self, error: float, cost: float) -> bool:
        """Tell, after one more turn, whether there should be no other of its kind.

        Parameters
        ----------
        error, cost
            The error after this turn, and what the turn cost.
        """
        fell = error < FALL * self._lowest
        self._lowest = error if fell else self._lowest
        self._losses = 0 if fell else self._losses + 1
        self._spent += cost
        return self._losses >= LOSSES or self._spent > self.budget
