"""ModelSettings: everything that fixes the shape of a Vector Heat Network, and two presets."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, get_args

from vhquad.errors import ConfigError

__all__ = ["PRESETS", "Head", "ModelSettings", "preset"]

Head = Literal["paper", "mixed"]


@dataclass(frozen=True)
class ModelSettings:
    """Sizes and choices of a network; saved beside its weights.

    Attributes
    ----------
    in_channels : int
        Complex channels of the input features.
    in_lines : int
        Lines among the input features; 0 for features that have none. With lines, vectors can be
        reflected at them before each block, and their squares are terms of the mixed head.
    channels : int
        Complex channels between the blocks, c in the paper.
    blocks : int
        Vector diffusion blocks, N in the paper.
    times : int
        Learned diffusion times of each block, m in the paper.
    k : int
        Eigenvectors of the connection Laplacian. Part of the model: another number is refused.
    hidden_layers : int
        Hidden layers of each block's vector MLP (2 in the paper).
    keep_input : bool
        Whether the block's first linear map also sees the undiffused features (not in the paper).
    dropout : float
        Share of complex numbers dropped at each hidden layer while training.
    order : int
        Rotational symmetry of the output: 1 a vector, 2 a line, 4 a cross.
    head : "paper" or "mixed"
        How the output is formed, see :mod:`vhquad.nn.heads`.
    head_terms : int
        Terms of the mixed head beside the first.
    features : str
        Name of the input features (``vhquad.geometry.features``).
    turned : bool
        Whether copies of the features turned by a right angle are among them.
    """

    in_channels: int = 30
    in_lines: int = 0
    channels: int = 128
    blocks: int = 4
    times: int = 4
    k: int = 128
    hidden_layers: int = 2
    keep_input: bool = True
    dropout: float = 0.0
    order: int = 4
    head: Head = "mixed"
    head_terms: int = 15
    features: str = "hks"
    turned: bool = True

    def __post_init__(self) -> None:
        for name in ("in_channels", "channels", "blocks", "times", "k", "hidden_layers"):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < 1:
                raise ConfigError(f"model setting {name} must be a whole number >= 1, not {value}")
        for name in ("in_lines", "head_terms"):
            value = getattr(self, name)
            if not isinstance(value, int) or value < 0:
                raise ConfigError(f"model setting {name} must be >= 0, not {value}")
        if self.order not in (1, 2, 4):
            raise ConfigError(f"model setting order must be 1, 2 or 4, not {self.order}")
        if self.head not in get_args(Head):
            raise ConfigError(
                f"model setting head must be one of {', '.join(get_args(Head))}, not {self.head!r}"
            )
        if not 0.0 <= self.dropout < 1.0:
            raise ConfigError(f"model setting dropout must be in [0, 1), not {self.dropout}")
        if not isinstance(self.features, str) or not self.features:
            raise ConfigError("model setting features must name the input features")

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ModelSettings:
        """From plain JSON values.

        Raises
        ------
        ConfigError
            If a name is unknown or a value is out of range.
        """
        if not isinstance(values, dict):
            raise ConfigError(f"model settings must be a JSON object, not {type(values).__name__}")
        known = {field.name for field in fields(cls)}
        foreign = sorted(set(values) - known)
        if foreign:
            raise ConfigError(f"unknown model settings: {json.dumps(foreign)}")
        return cls(**values)


PRESETS: dict[str, ModelSettings] = {
    # Gao et al. 2024, "Implementation details"; the number m of times is not said there.
    "paper": ModelSettings(
        channels=256, blocks=6, times=4, keep_input=False, dropout=0.5, head="paper", head_terms=0
    ),
    # What models/default.safetensors was before it got two blocks more: a quarter of the time a
    # step, a third of the loss.
    "starter": ModelSettings(hidden_layers=1, in_channels=72, in_lines=6, features="local"),
}


def preset(name: str) -> ModelSettings:
    """One of :data:`PRESETS` by name.

    Raises
    ------
    ConfigError
        If there is none of that name.
    """
    if name not in PRESETS:
        raise ConfigError(f"no model preset {name!r}; there are {', '.join(sorted(PRESETS))}")
    return PRESETS[name]
