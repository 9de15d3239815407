"""What exists: hooks, the records that plug-ins yield, and the registry that gathers them."""
