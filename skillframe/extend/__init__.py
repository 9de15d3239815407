"""Hooks, the records that plug-ins yield, and the registry that collects them."""
