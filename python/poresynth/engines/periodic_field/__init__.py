"""An implicit periodic field network (ipfn_2022): images and volumes from one example."""

from poresynth.engines.periodic_field.engine import PeriodicField

__all__ = ["PeriodicField"]
