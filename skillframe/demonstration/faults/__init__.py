"""Stretches of a recording that are not what happened: steps, copies, saturation, jumps, and what they touch."""
