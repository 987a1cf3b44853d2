"""The exceptions that vhquad raises on purpose; each message says what, where, and what to try.

VhquadError
 ├── MeshError              a mesh cannot be read, or cannot be used as it is
 ├── FieldError             a cross field does not fit its mesh or its file is wrong
 ├── ParametrizationError   no usable integer-grid map could be made
 ├── ModelError             a checkpoint is missing, damaged, foreign or does not fit
 ├── DatasetError           a training set is missing, empty or damaged
 └── ConfigError            a setting is out of range or contradicts another
"""

from __future__ import annotations

__all__ = [
    "ConfigError",
    "DatasetError",
    "FieldError",
    "MeshError",
    "ModelError",
    "ParametrizationError",
    "VhquadError",
]


class VhquadError(Exception):
    """Base of every error that vhquad raises on purpose."""


class MeshError(VhquadError):
    """A mesh cannot be read, or cannot be used as it is."""


class FieldError(VhquadError):
    """A cross field does not fit its mesh, or its file is wrong."""


class ParametrizationError(VhquadError):
    """No usable integer-grid map could be made from the field."""


class ModelError(VhquadError):
    """A checkpoint is missing, damaged, foreign or does not fit."""


class DatasetError(VhquadError):
    """A training set is missing, empty or damaged."""


class ConfigError(VhquadError):
    """A setting is out of range, or contradicts another."""
