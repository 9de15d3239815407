"""skillframe plug-in: baselines."""
