"""The table of the shapes that a section can have: names, numbers and words of each.

Their geometry is in the classes of `slideviz.sections.model`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class Words:
    """The window's words for a shape, in 3D meshes or in 2D meshes."""

    name: str  # text of the button that adds a section of the shape
    action: str  # text of the menu that does so, with its mnemonic letter after "&"
    add: str
    """`add`, `handle`, `flat`, `look`: tips: of the button that adds one, of its handle, of its
    flat view, and of the button that turns the camera to it."""
    handle: str
    flat: str
    flat_name: str  # the name of the flat view
    look: str = ""


@dataclass(frozen=True)
class Size:
    """A number of a shape besides its point and direction, such as a radius; always above 0."""

    field: str  # its name in `slideviz.sections.shape.Section` and in reports
    label: str
    word: str  # `label`, `word`: what it is called in a form, and in a sentence
    unit: str  # its unit in words, for a tip
    remedy: str  # what to give instead of a wrong value, for messages
    example: str  # an example of the option of the command line, in words
    high: float = inf  # values must be below this
    usual: float = 1.0  # the value where none is given
    picks: tuple[float, ...] = ()  # values that the window offers as buttons

    def fault(self, value: float) -> str:
        """Return why a value is not allowed, as the end of a sentence; "" where it is."""
        if not value > 0:
            return "is not positive"
        return "" if value < self.high else f"is not below {self.high:g}"


@dataclass(frozen=True)
class ShapeTerms:
    """The names, numbers and words of a shape."""

    value: str  # its name in case files, on the command line and in reports
    direction: str  # what its direction is called: normal or axis
    point: str
    """The label of its point in a form; empty where a position along the direction is given
    instead."""
    about: str  # what its point is, in words
    size: Size | None
    """Its own number, which a slider moves; None: the slider moves its position along the
    direction."""
    flat: str  # the word in a case file for a section that is shown in a flat view, too
    numbers: str
    meaning: str  # `numbers`, `meaning`: its numbers in a case file, as symbols and in words
    option: str  # help text of the option of the command line
    tip_to_add: str  # tip of the action that adds a section of the shape
    words: dict[int, Words]
    """The window's words, by the dimensions of meshes that the shape can cut."""
    one_way: bool = False  # whether the opposite direction gives another section
    key: str = ""  # the shortcut that adds a section of the shape; empty for none
    metavar: str | None = None  # the placeholder for its value in the help of the command line

    @property
    def count(self) -> int:
        """Return the count of a shape's numbers in a case file: size, direction and point."""
        return 6 if self.size is None else 7

    @property
    def letter(self) -> str:
        """Return the symbol of its size in a case file, ``r`` or ``a``; ``nx`` for a plane."""
        return self.numbers.partition(",")[0]

    def point_tip(self, dim: int) -> str:
        """Return the tip of the fields of the point, for meshes of ``dim`` dimensions."""
        name = self.words[dim].name.lower()
        return f"The middle of the {name}" if dim == 2 else self.about.capitalize()

    def tip(self, dim: int) -> str:
        """Return the tip of the number that a slider moves, for meshes of ``dim`` dimensions."""
        if self.size is not None:
            return f"The {self.size.word}, in {self.size.unit}."
        name = self.words[dim].name.lower()
        return f"How far the {name} is from 0 along its normal, in the mesh's length unit."


_CURVE = "Show the quality of the cells along the section beside the view."
_AXIS = (
    "then the axis: x, y, z, or its direction ax,ay,az, and after it {point} cx,cy,cz if not 0; "
    "without axis the axis of the rotational period, else z"
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
            "coordinate, e.g. z=0.5",
            key="C",
            tip_to_add="Show the cells that a plane, in 2D a line, cuts, and put it where you "
            "want.",
            words={
                3: Words(
                    "Plane",
                    "&Cut by a plane",
                    add="Add a plane through the middle of the mesh.",
                    handle="Drag the arrow in the view to push the plane, or a ring to tilt it.",
                    flat="Show the section along its normal beside the 3D view.",
                    flat_name="Flat view",
                    look="Look along the normal.",
                ),
                2: Words(
                    "Line",
                    "&Cut by a line",
                    add="Add a line through the middle of the mesh.",
                    handle="Drag the arrow or the middle of the line in the view to move it, or "
                    "the ring to turn it.",
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
                example="a radius, e.g. 0.25, r=0.25 or 0.25,x",
            ),
            flat="unrolled",
            numbers="r, ax, ay, az, x, y, z",
            meaning="radius, axis and a point on it",
            option="radius, e.g. 0.25 or r=0.25, " + _AXIS.format(point="a point on it"),
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
                    look="Look at the cylinder from outside, at the middle of the cells that it "
                    "cuts.",
                ),
                2: Words(
                    "Circle",
                    "Cut by a circl&e",
                    add="Add a circle around the moving body, or about the axis of the period.",
                    handle="Drag the middle of the circle in the view to move it, or the ball on "
                    "it to change its radius.",
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
                example="a half angle in degrees, e.g. 15, a=15 or 15,0,0,1,0,0,-2",
                high=90.0,
                usual=20.0,
            ),
            flat="unrolled",
            numbers="a, ax, ay, az, x, y, z",
            meaning="half angle in degrees, axis along which it opens and apex",
            option="half angle in degrees, e.g. 15 or a=15, "
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
                    look="Look at the cone from outside, at the middle of the cells that it cuts.",
                )
            },
        ),
        ShapeTerms(
            "span",
            direction="axis",
            point="Centre",
            about="a point of the axis",
            size=Size(
                "span",
                "Span",
                "span",
                unit="parts of the way from hub to shroud",
                remedy="give a number between 0, the hub, and 1, the shroud: 0.5 for 50 %",
                example="a span, e.g. 0.5 or s=0.5",
                high=1.0,
                usual=0.5,
                picks=(0.1, 0.5, 0.9),
            ),
            flat="unrolled",
            numbers="s, ax, ay, az, x, y, z",
            meaning="span between the walls of SPAN, axis and a point on it",
            option="constant span between hub (0) and shroud (1), e.g. 0.5, "
            + _AXIS.format(point="a point on it"),
            one_way=True,
            tip_to_add="Show the cells on a surface of constant span, and lay it flat to m′ and θ.",
            key="Alt+Shift+C",
            metavar="S[,AXIS]",
            words={
                3: Words(
                    "Span",
                    "Cut at constant &span",
                    add="Add a section halfway between hub and shroud.",
                    handle="Drag the ball in the view to change the span.",
                    flat="Show the section laid flat to m′ and θ beside the 3D view; angles are "
                    "as they are.",
                    flat_name="Laid flat",
                    look="Look at the section from outside, at the middle of the cells that it "
                    "cuts.",
                )
            },
        ),
    )
}
"""All shapes by their ``value``."""


def names(dim: int = 3) -> str:
    """Return the names of the shapes for meshes of ``dim`` dimensions, as in "plane or cone"."""
    every = [row.words[dim].name.lower() for row in SECTION_SHAPES.values() if dim in row.words]
    return f"{', '.join(every[:-1])} or {every[-1]}"
