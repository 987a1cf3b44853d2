"""vhquad: from a triangle mesh to an all-quad mesh whose edges flow as an artist would draw them.

The names a script needs, imported when first used::

    import vhquad

    mesh = vhquad.load("head.obj").mesh
    result = vhquad.remesh(mesh.vertices, mesh.faces, target_quads=4000)
    print(result.report.made)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vhquad.api import load, predict, remesh
    from vhquad.errors import VhquadError
    from vhquad.field.cross import CrossField
    from vhquad.mesh.quad import QuadMesh
    from vhquad.mesh.triangle import TriMesh
    from vhquad.quad.pipeline import RemeshResult, RemeshSettings
    from vhquad.report import RemeshReport

__version__ = "0.1.0"

__all__ = [
    "CrossField",
    "QuadMesh",
    "RemeshReport",
    "RemeshResult",
    "RemeshSettings",
    "TriMesh",
    "VhquadError",
    "__version__",
    "load",
    "predict",
    "remesh",
]

_HOMES = {
    "CrossField": "vhquad.field.cross",
    "QuadMesh": "vhquad.mesh.quad",
    "RemeshReport": "vhquad.report",
    "RemeshResult": "vhquad.quad.pipeline",
    "RemeshSettings": "vhquad.quad.pipeline",
    "TriMesh": "vhquad.mesh.triangle",
    "VhquadError": "vhquad.errors",
    "load": "vhquad.api",
    "predict": "vhquad.api",
    "remesh": "vhquad.api",
}


def __getattr__(name: str) -> Any:
    """Import a public name at its first use (PEP 562), so that ``import vhquad`` is instant."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names, imported or not, beside what is there."""
    return sorted({*globals(), *__all__})
