"""Simulated people who demonstrate: hand on the tool, blindfolded, or at a teleoperation station."""
