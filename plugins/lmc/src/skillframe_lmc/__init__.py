"""skillframe plug-in: lmc."""
