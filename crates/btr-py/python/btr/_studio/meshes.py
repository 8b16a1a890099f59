"""The meshes that a robot's URDF names, read from beside it."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Union
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from btr.model import Model

LARGEST_BYTES = 50_000_000
FORMATS = (".stl", ".obj", ".ply", ".glb", ".dae")

# glTF has y up, URDF z: `crates/btr-lab/src/meshes/gltf.rs` has who does so as well.
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices in m, shape (vertices, 3), and the vertices' numbers of each face, shape (faces, 3)."""


def folder_of(model: Model) -> Union[Path, None]:
    """The folder of the model's URDF; None where the model has no such file, or nothing here reads TOML."""
    reader = _first_of("tomllib", "tomli")
    if reader is None:
        return None
    urdf = reader.loads(model.text).get("robot", {}).get("urdf")
    return None if urdf is None else (model.path.parent / urdf).resolve().parent


def found(name: str, folder: Path) -> Union[Path, None]:
    """The file of a mesh: below the URDF's folder, or below the folder of the package that holds it. None for any other
    place, and for what is no file."""
    address = urlsplit(name)
    root, path = folder, unquote(address.path)
    if address.scheme == "package":
        packages = [parent for parent in (folder, *folder.parents) if parent.name == address.netloc]
        root, path = (packages[0] if packages else folder), path.lstrip("/")
    elif address.scheme not in ("", "file"):
        return None
    root = root.resolve()
    whole = (root / path).resolve()
    is_own = whole.is_relative_to(root) and whole.suffix.lower() in FORMATS and whole.is_file()
    return whole if is_own and whole.stat().st_size <= LARGEST_BYTES else None


def read(path: Path, scale: tuple[float, float, float]) -> Union[Mesh, None]:
    """The triangles of a file; None if it cannot be read."""
    load: Union[Callable[..., Any], None] = getattr(_first_of("trimesh"), "load", None)
    if load is None:
        return None
    try:
        # An open file has no folder: nothing that it names is read.
        with path.open("rb") as file:
            mesh = load(file, file_type=path.suffix[1:].lower(), force="mesh")
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    except Exception:
        # Every format fails in its own way; the link is then drawn as a rod.
        return None
    if path.suffix.lower() == ".glb":
        vertices = vertices @ _Y_TO_Z
    return (vertices * scale, faces) if len(faces) else None


def _first_of(*libraries: str) -> Any:
    """The first of these libraries that is there; None without any."""
    for library in libraries:
        try:
            return importlib.import_module(library)
        except ImportError:
            continue
    return None
