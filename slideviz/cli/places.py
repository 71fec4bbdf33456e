"""Where results are to go: looked at before the work, so that it is not done in vain."""

from __future__ import annotations

from pathlib import Path


def require_files(*files: Path | None) -> None:
    """Raise where a file cannot be written; None and ``-``, the terminal, always can.

    Raises
    ------
    CaseError
        The folder is missing, there is no permission, or a folder has that name.
    """
    from slideviz.errors import CaseError
    from slideviz.mesh.atomic import require_writable

    for file in files:
        if file is not None and str(file) != "-":
            require_writable(file, CaseError)


def require_mesh_file(file: Path) -> None:
    """Raise where a mesh cannot be written: as `require_files`, or its ending is unknown.

    Raises
    ------
    SlidevizError
        It cannot.
    """
    if file.suffix.lower() not in (".su2", ".vtu"):
        from slideviz.mesh.quiet_meshio import formats_of

        formats_of(file)
    require_files(file)


def make_folder(folder: Path) -> None:
    """Make a folder, and those it is in, where there is none.

    Raises
    ------
    CaseError
        It cannot be made.
    """
    from slideviz.errors import CaseError
    from slideviz.mesh.atomic import reason_of

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise CaseError(f"{folder}: cannot be made a folder: it is a file") from None
    except OSError as problem:
        raise CaseError(f"{folder}: cannot be made a folder: {reason_of(problem)}") from None
