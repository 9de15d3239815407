"""Controller of hydraulic machines: virtual decomposition control."""
