"""The radial functions by name and words, for whoever asks which there are."""

from __future__ import annotations

from slideviz.rbf.kernels import KERNELS


def kernel_titles() -> dict[str, str]:
    """Return the words for each value of RBF_KERNEL, in the order of thesis Tables 2.1 and 2.2."""
    reach = {True: "compact", False: "global"}
    return {name: f"{one.title} ({reach[one.compact]})" for name, one in KERNELS.items()}
