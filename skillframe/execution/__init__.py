"""The simulation loop, its drives and its results."""
