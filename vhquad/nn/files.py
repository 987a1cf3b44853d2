"""Where models lie: found without loading any."""

from __future__ import annotations

from pathlib import Path

from vhquad.errors import ModelError

__all__ = ["default_model_path", "model_file"]


def model_file(path: Path | str | None = None) -> Path:
    """The weights that a name stands for: a file, a folder that holds model.safetensors, or the
    shipped ones (None or "default")."""
    if path is None or str(path) == "default":
        return default_model_path()
    path = Path(path)
    return path / "model.safetensors" if path.is_dir() else path


def default_model_path() -> Path:
    """Where the shipped model lies: in the installed package, else in the source checkout.

    Raises
    ------
    ModelError
        If it is in neither.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / "models", package.parent / "models"):
        candidate = folder / "default.safetensors"
        if candidate.exists():
            return candidate
    raise ModelError(
        f"the default model is missing (looked in {package / 'models'}); reinstall vhquad, or name "
        "a model with --model"
    )
