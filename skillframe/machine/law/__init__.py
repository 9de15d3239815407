"""The control law of hydraulic machines: virtual decomposition control, readable and compiled."""
