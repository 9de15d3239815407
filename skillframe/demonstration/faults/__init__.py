"""Stretches of a recording that are no valid measurement: steps, copies, saturation and jumps."""
