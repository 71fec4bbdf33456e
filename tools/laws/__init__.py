"""Random meshes and cases, and the laws that every deformation of them has to obey.

``meshes`` and ``cases`` draw a run from one whole number, its seed; ``oracle`` and ``surfaces``
have slow, plain ways to tell where nodes must be; ``laws`` has the laws, and ``check`` holds a
run against them.
"""
