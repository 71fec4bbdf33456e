"""Where a mesh of OpenFOAM is: the file that stands for it.

That is its ``points`` (``points.gz``), or of several regions ``regionProperties``. A case's folder,
one of its times, its ``polyMesh``, and a ``.foam`` file in it lead to that file.
"""

from __future__ import annotations

from pathlib import Path

ENDING = ".foam"
TWO_PARTS = ".ugrid"
"""The last part of an ending that has another one before it."""
REGIONS = "regionProperties"
_NAMES = ("points", "points.gz", REGIONS)
_CONTROL = Path("system/controlDict")  # a case has it, also before it has a mesh


def ending_of(path: Path) -> str:
    """Return the ending of a mesh file, in lower case: ``.foam`` for one of OpenFOAM.

    That of UGRID has two parts: ``.b8.ugrid``.
    """
    if path.name in _NAMES:
        return ENDING
    suffix = path.suffix.lower()
    return "".join(path.suffixes[-2:]).lower() if suffix == TWO_PARTS else suffix


def instance_of(path: Path) -> tuple[Path, str]:
    """Return the folder ``constant`` or time of a mesh's file, and the region of its ``points``."""
    within = path.parent if path.name == REGIONS else path.parent.parent
    outside = within.parent
    if outside.name == "constant" or is_time(outside):
        return outside, within.name
    return within, ""


def case_folder(path: Path) -> Path:
    """Return the folder of the case of a mesh's ``points`` or ``regionProperties``."""
    return instance_of(path.absolute())[0].parent


def folder_of(path: Path) -> Path:
    """Return the folder where a user looks for a mesh file: of OpenFOAM that of its case."""
    return case_folder(path) if path.name in _NAMES else path.parent


def stem_of(path: Path) -> str:
    """Return the name of a mesh file without its ending; of OpenFOAM that of its case."""
    if path.name in _NAMES:
        return case_folder(path).name or "mesh"
    return path.name[: len(path.name) - len(ending_of(path))]


def shown_name(path: Path) -> str:
    """Return the name of a file for titles; of OpenFOAM that of its case, with the time if any."""
    if path.name not in _NAMES:
        return path.name
    instance = instance_of(path.absolute())[0]
    time = "" if instance.name == "constant" else f", time {instance.name}"
    return f"{instance.parent.name}{time}"


def is_time(folder: Path) -> bool:
    """Return whether a folder is one of a case's times."""
    return folder.name.replace(".", "", 1).isdecimal() and (folder.parent / "constant").is_dir()


def _is_constant(folder: Path) -> bool:
    return folder.name == "constant" and (folder.parent / _CONTROL).is_file()


def lacks_mesh(path: Path) -> bool:
    """Return whether a mesh's ``points`` would be in a case that has no mesh."""
    return path.name in _NAMES and not path.parent.exists() and case_folder(path).is_dir()


def mesh_path(path: Path) -> Path:
    """Return the file that stands for a mesh, which need not exist; other paths as they are.

    So are those that the system does not let us look at: who reads them says why.
    """
    try:
        return _mesh_path(path)
    except OSError:
        return path


def _mesh_path(path: Path) -> Path:
    folder = path
    if path.suffix.lower() == ENDING:
        folder = path.parent if (path.parent / "constant").is_dir() else path.with_suffix("")
    constant = folder / "constant"
    if folder.name == "polyMesh" and folder.is_dir():
        mesh = folder
    elif (folder / "polyMesh").is_dir() or is_time(folder) or _is_constant(folder):
        mesh = folder / "polyMesh"
    elif (constant / REGIONS).is_file() and any(constant.glob("*/polyMesh")):
        return constant / REGIONS
    elif folder != path or constant.is_dir() or (folder / _CONTROL).is_file():
        mesh = constant / "polyMesh"
    else:
        return path
    packed = mesh / "points.gz"
    return packed if packed.exists() and not (mesh / "points").exists() else mesh / "points"
