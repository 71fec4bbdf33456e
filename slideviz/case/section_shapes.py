"""The shapes that a section can have: their names, numbers and words, without their geometry.

The geometry of each is in `slideviz.sections.model.SHAPES`, by the same names.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class Words:
    """The words for a shape in meshes of 3 or of 2 dimensions.

    Attributes
    ----------
    name : str
        On the button that adds one.
    action : str
        The same in the menu, with its letter marked.
    add, handle, flat, look : str
        What the button to add one, the handle, the flat view and the button to look do.
    flat_name : str
        What the flat view is called.
    """

    name: str
    action: str
    add: str
    handle: str
    flat: str
    flat_name: str
    look: str = ""


@dataclass(frozen=True)
class Size:
    """The number of a shape beside a point and a direction; it is above 0.

    Attributes
    ----------
    field : str
        Its name in `slideviz.sections.model.Section` and in reports.
    label, word : str
        In a form and in a sentence.
    unit : str
        Of what, in a tip.
    remedy : str
        What to give instead of a wrong one.
    high : float
        What it is below.
    usual : float
        One to start from.
    example : str
        One on the command line.
    """

    field: str
    label: str
    word: str
    unit: str
    remedy: str
    example: str
    high: float = inf
    usual: float = 1.0

    def fault(self, value: float) -> str:
        """Return why a number is no size, after its value; nothing where it is one."""
        if not value > 0:
            return "is not positive"
        return "" if value < self.high else f"is not below {self.high:g}"


@dataclass(frozen=True)
class ShapeTerms:
    """The names, numbers and words of a shape.

    Attributes
    ----------
    value : str
        Its name in case files, on the command line and in reports.
    direction : str
        What its direction is.
    point : str
        What its point is called in a form; empty where the position says it.
    about : str
        What its point is.
    size : Size or None
        Its own number, the one that a slider moves; without one, the position along the direction.
    flat : str
        What stands in a case file where it is laid flat beside the view.
    numbers, meaning : str
        Of a case file: its numbers, and what they are.
    option : str
        Help of the option of the command line.
    tip_to_add : str
        What the action that adds one does.
    words : dict of int to Words
        By the dimensions of the mesh; it can cut only meshes of these.
    one_way : bool
        Whether it is another section in the opposite direction.
    key : str
        Of the keyboard, to add one.
    metavar : str or None
    """

    value: str
    direction: str
    point: str
    about: str
    size: Size | None
    flat: str
    numbers: str
    meaning: str
    option: str
    tip_to_add: str
    words: dict[int, Words]
    one_way: bool = False
    key: str = ""
    metavar: str | None = None

    @property
    def count(self) -> int:
        """Return how many numbers a shape has in a case file: size, direction and point."""
        return 6 if self.size is None else 7

    @property
    def letter(self) -> str:
        """Return the letter of its first number."""
        return self.numbers.partition(",")[0]

    def point_tip(self, dim: int) -> str:
        """Return the tip of the point."""
        name = self.words[dim].name.lower()
        return f"The middle of the {name}" if dim == 2 else self.about.capitalize()

    def tip(self, dim: int) -> str:
        """Return the tip of the number that a slider moves."""
        if self.size is not None:
            return f"The {self.size.word}, in {self.size.unit}."
        name = self.words[dim].name.lower()
        return f"How far the {name} is from 0 along its normal, in the mesh's length unit."


_CURVE = "Show the quality of the cells along the section beside the view."
_AXIS = (
    "then the axis: x, y, z, or its direction ax,ay,az, and after it {point} cx,cy,cz if not 0; "
    "without axis that of the rotational period, else z"
)

SECTION_SHAPES = {
    row.value: row
    for row in (
        ShapeTerms(
            "plane",
            direction="normal",
            point="",
            about="a point",
            size=None,
            flat="flat",
            numbers="nx, ny, nz, x, y, z",
            meaning="normal and a point",
            option="normal and a point: nx,ny,nz,x,y,z (2D: nx,ny,x,y); or an axis and a "
            "coordinate, as in z=0.5",
            key="C",
            tip_to_add="Show the cells that a plane, in 2D a line, cuts, and put it where you "
            "want.",
            words={
                3: Words(
                    "Plane",
                    "&Cut by a plane",
                    add="Add a plane through the middle of the mesh.",
                    handle="Drag the plane in the view: its face moves it, the arrow turns it.",
                    flat="Show the section along its normal beside the 3D view.",
                    flat_name="Flat view",
                    look="Look along the normal.",
                ),
                2: Words(
                    "Line",
                    "&Cut by a line",
                    add="Add a line through the middle of the mesh.",
                    handle="Drag the line in the view: itself or its middle moves it, its ends "
                    "turn it.",
                    flat=_CURVE,
                    flat_name="Curve",
                ),
            },
        ),
        ShapeTerms(
            "cylinder",
            direction="axis",
            point="Centre",
            about="a point of the axis",
            size=Size(
                "radius",
                "Radius",
                "radius",
                unit="the mesh's length unit",
                remedy="give the distance of the section from its axis",
                example="a radius, as in 0.25, r=0.25 or 0.25,x",
            ),
            flat="unrolled",
            numbers="r, ax, ay, az, x, y, z",
            meaning="radius, axis and a point on it",
            option="radius, as in 0.25 or r=0.25, " + _AXIS.format(point="a point on it"),
            key="Shift+C",
            tip_to_add="Show the cells that a cylinder about the axis cuts, and unroll it; in 2D a "
            "circle.",
            metavar="R[,AXIS]",
            words={
                3: Words(
                    "Cylinder",
                    "Cut by a c&ylinder",
                    add="Add a cylinder about the axis of the machine.",
                    handle="Drag the ball in the view to change the radius.",
                    flat="Show the cylinder unrolled to axis and r θ beside the 3D view.",
                    flat_name="Unrolled",
                    look="Look at the cylinder from outside, at the middle of what it cuts.",
                ),
                2: Words(
                    "Circle",
                    "Cut by a circl&e",
                    add="Add a circle around what moves, or about the axis of the period.",
                    handle="Drag the circle in the view: its middle moves it, itself changes the "
                    "radius.",
                    flat=_CURVE,
                    flat_name="Curve",
                ),
            },
        ),
        ShapeTerms(
            "cone",
            direction="axis",
            point="Apex",
            about="the apex",
            size=Size(
                "half_angle_deg",
                "Half angle",
                "half angle",
                unit="degrees",
                remedy="give the angle in degrees between its axis and its lines",
                example="a half angle in degrees, as in 15, a=15 or 15,0,0,1,0,0,-2",
                high=90.0,
                usual=20.0,
            ),
            flat="unrolled",
            numbers="a, ax, ay, az, x, y, z",
            meaning="half angle in degrees, axis along which it opens and apex",
            option="half angle in degrees, as in 15 or a=15, "
            + _AXIS.format(point="the apex")
            + "; it opens along the axis",
            one_way=True,
            tip_to_add="Show the cells that a cone about the axis cuts, and unroll it.",
            key="Alt+C",
            metavar="DEGREES[,AXIS]",
            words={
                3: Words(
                    "Cone",
                    "Cut by a co&ne",
                    add="Add a cone about the axis of the machine.",
                    handle="Drag the ball in the view to change the half angle.",
                    flat="Show the cone unrolled, its apex at 0, beside the 3D view.",
                    flat_name="Unrolled",
                    look="Look at the cone from outside, at the middle of what it cuts.",
                ),
            },
        ),
    )
}
"""By name; see `ShapeTerms`."""


def names(dim: int = 3) -> str:
    """Return the names of shapes in meshes of 3 or 2 dimensions, as a list in a sentence."""
    every = [row.words[dim].name.lower() for row in SECTION_SHAPES.values() if dim in row.words]
    return f"{', '.join(every[:-1])} or {every[-1]}"
