"""More blocks for a trained network that at first change nothing: the start of further training.

A block whose last maps are zero is the identity (Chen, Goodfellow, Shlens 2016, "Net2Net"; here the
residual form of it), so the deeper network answers as the one it comes from until it learns better.
"""

from __future__ import annotations

from dataclasses import replace

import torch

from vhquad.errors import ConfigError
from vhquad.nn.layers import VectorLinear
from vhquad.nn.network import DiffusionBlock, VectorHeatNet

__all__ = ["deepened"]


def deepened(network: VectorHeatNet, blocks: int, seed: int = 0) -> VectorHeatNet:
    """A network of more blocks with the same answers, bit for bit.

    Parameters
    ----------
    network : VectorHeatNet
    blocks : int
        Blocks in all; new ones are spread evenly behind the old.
    seed : int
        Of the weights of new blocks that their zeros hide.

    Raises
    ------
    ConfigError
        If the network has more blocks already.
    """
    old = network.settings.blocks
    if blocks < old:
        raise ConfigError(f"the network has {old} blocks, {blocks} are no more")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        made = VectorHeatNet(replace(network.settings, blocks=blocks))
    for name in ("enter", "leave", "head"):
        getattr(made, name).load_state_dict(getattr(network, name).state_dict())
    # Old block i goes behind as many new ones as its share of the depth before it.
    place = [i + (blocks - old) * i // old for i in range(old)]
    for at, block in enumerate(made.blocks):
        assert isinstance(block, DiffusionBlock)
        if at in place:
            block.load_state_dict(network.blocks[place.index(at)].state_dict())
        else:
            _silence(block)
    return made.to(next(network.parameters())).train(network.training)


@torch.no_grad()
def _silence(block: DiffusionBlock) -> None:
    """Make a block the identity. Gradients still reach the weights that are set to zero."""
    if block.reflection is not None:
        block.reflection.lines.weight.zero_()
    last = block.mlp.layers[-1]
    assert isinstance(last, VectorLinear)
    last.weight.zero_()
