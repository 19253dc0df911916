"""Training of the joint network: simulated crops, the network in PyTorch, export in whole numbers.

Needs the extra `training` (`pip install .[training]`). The recipe is in `docs/models.md`.
"""
