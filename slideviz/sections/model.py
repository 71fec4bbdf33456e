"""Sections of all shapes: whoever takes `Section` from here has the classes of all."""

from __future__ import annotations

from slideviz.sections.plane import Plane
from slideviz.sections.quadrics import Cone, Cylinder
from slideviz.sections.shape import ON_SECTION, Section, Triple
from slideviz.sections.span import ConstantSpan

__all__ = ["ON_SECTION", "Cone", "ConstantSpan", "Cylinder", "Plane", "Section", "Triple"]
