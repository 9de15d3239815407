"""Robots by URDF: robot.toml, loading, mass audit, kinematics and dynamics."""
