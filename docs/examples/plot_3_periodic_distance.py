"""
The periodic distance
=====================

A motion near one periodic side acts on nodes near the other side, because the distance between
nodes is periodic, as the mesh is.
"""

import matplotlib.pyplot as plt
import numpy as np

PERIOD = 1.0
SUPPORT_RADIUS = 2.5

# %%
# In the direction of the period λ, a difference Δ is replaced by (λ/π) sin(π Δ/λ) (thesis, Eq.
# 2.13). This is the chord of an arc of length Δ on a circle of circumference λ: nearly Δ for close
# nodes, and 0 again after one period.

difference = np.linspace(0, 2 * PERIOD, 401)
periodic = np.abs(PERIOD / np.pi * np.sin(np.pi * difference / PERIOD))


def wendland_c2(distance):
    """Return Wendland's C2 function, which is 1 at distance 0 and 0 from the support radius on."""
    part = np.minimum(distance / SUPPORT_RADIUS, 1)
    return (1 - part) ** 4 * (4 * part + 1)


figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
for axes, shape in ((left, lambda d: d), (right, wendland_c2)):
    axes.plot(difference, shape(difference), "--", color="0.5", label="plain distance")
    axes.plot(difference, shape(periodic), color="C0", label="periodic distance")
    axes.axvline(PERIOD, color="0.8", zorder=0)
    axes.set_xlabel("difference / period")
left.set(title="distance", ylabel="distance / period")
right.set(title="radial function (Wendland C2)", ylabel="value")
left.legend()
plt.show()
