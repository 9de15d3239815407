"""The contact force of a hydraulic machine, estimated from its pressures."""
