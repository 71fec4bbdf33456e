"""Random meshes and cases, and the laws that every deformation of them has to obey.

``meshes`` and ``cases`` draw a run from one whole number, its seed; ``oracle`` has slow, plain
ways to tell where nodes must be; ``check`` holds the runs against the laws.
"""
