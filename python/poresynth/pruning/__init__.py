"""What a synthesis cannot promise, put right: loose ends, floating parts, closed pores."""

from poresynth.pruning.connecting import Connected, connect
from poresynth.pruning.prune import prune
from poresynth.pruning.record import Edit, Pruned, Standing

__all__ = ["Connected", "Edit", "Pruned", "Standing", "connect", "prune"]
