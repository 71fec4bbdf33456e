"""What is changed in VTK's shaders: lines between cells, and faces that are seen through."""

from __future__ import annotations

from typing import Any

_LINE = (
    "float emix = clamp(0.5 + 0.5*lineWidth - min( min( edist[0], edist[1]), edist[2]), 0.0, 1.0);"
)
"""How VTK's shader says how much of a pixel the edges of its triangle cover."""
_FADING = """vec3 sines = abs(vec3(
    edgeEqn[1].x * edgeEqn[2].y - edgeEqn[1].y * edgeEqn[2].x,
    edgeEqn[2].x * edgeEqn[0].y - edgeEqn[2].y * edgeEqn[0].x,
    edgeEqn[0].x * edgeEqn[1].y - edgeEqn[0].y * edgeEqn[1].x));
  vec3 inside = vec3(edist[0] - edgeEqn[0].z, edist[1] - edgeEqn[1].z, edist[2] - edgeEqn[2].z);
  vec3 across = abs(dot(sines, inside)) / max(sines, vec3(1e-6));
  vec3 cover = clamp(0.5 + 0.5*lineWidth - vec3(edist[0], edist[1], edist[2]), 0.0, 1.0);
  cover *= smoothstep(1.5 * lineWidth, 5.0 * lineWidth, across);
  float emix = max(max(cover.x, cover.y), cover.z);"""
"""The same, each line by itself, and none where the triangle reaches less than 1.5 widths of a
line from it: lines one beside the other would be a dark area, or dashes without multisampling.

By the law of sines that height is a sum: of the distances to the three sides, each times the sine
of the angle opposite of it.
"""

_MIX = "ambientColor = mix( ambientColor, edgeColor, emix * edgeOpacity);"
"""How VTK's shader puts them over the colour of the face."""
_STRONGER = """vec3 luma = vec3(0.30, 0.59, 0.11);
  float gap = abs(dot(ambientColor + diffuseColor / max(1.0 - emix * edgeOpacity, 0.01), luma)
    - dot(edgeColor, luma));
  float strong = mix(min(2.1 * edgeOpacity, 1.0), edgeOpacity, smoothstep(0.1, 0.5, gap));
  ambientColor = mix(ambientColor, edgeColor, emix * strong);
  diffuseColor *= (1.0 - emix * strong) / max(1.0 - emix * edgeOpacity, 0.01);"""
"""The same, less seen through where the face is nearly as dark as the line.

It is always the same colour: lines that turn from dark to light look like a jump of the values.
"""

_DEPTH = "//VTK::Depth::Impl"
_BEHIND = _DEPTH + "\n  gl_FragDepth = 1.0;"


def draw_fine_edges(actor: Any) -> None:
    """Let an actor's edges fade where its cells are hardly larger than lines.

    A VTK with other shaders draws its own edges. Actors that share a mapper must share the
    ``ShaderProperty``, too: the one that is drawn first decides for all of them.
    """
    shader = actor.GetShaderProperty()
    shader.AddFragmentShaderReplacement(_LINE, False, _FADING, False)
    shader.AddFragmentShaderReplacement(_MIX, False, _STRONGER, False)


def see_through(actor: Any, opacity: float) -> None:
    """Give an actor an opacity; below 1 it is behind all that is opaque, wherever it lies.

    Glass in front of a cut would tint it, and its colours would no longer be those of the bar.
    """
    actor.GetProperty().SetOpacity(opacity)
    glass = opacity < 1.0
    if bool(actor.GetForceOpaque()) == glass:
        return
    # Drawn with what is opaque, and as far away as can be: only the background is mixed in.
    actor.SetForceOpaque(glass)
    shader = actor.GetShaderProperty()
    if glass:
        shader.AddFragmentShaderReplacement(_DEPTH, True, _BEHIND, False)
    else:
        shader.ClearFragmentShaderReplacement(_DEPTH, True)
