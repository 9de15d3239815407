"""Control laws: impedance (equation 1), damping design, safety limits."""
