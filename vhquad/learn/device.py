"""Where to compute: CUDA where there is one, else the CPU."""

from __future__ import annotations

import torch

from vhquad.errors import ConfigError

__all__ = ["choose_device"]


def choose_device(name: str) -> torch.device:
    """ "auto" is CUDA where there is one, else the CPU.

    Raises
    ------
    ConfigError
        If the device does not exist here.
    """
    if name == "auto":
        name = "cuda" if torch.cuda.is_available() else "cpu"
    try:
        device = torch.device(name)
        torch.zeros(1, device=device)
    except Exception as error:  # torch raises many kinds
        reason = (str(error).splitlines() or ["unknown"])[0]
        raise ConfigError(f"--device {name} cannot be used: {reason}") from None
    return device
