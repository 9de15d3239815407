"""Control laws: impedance (equation 1), damping design, safety limits."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
