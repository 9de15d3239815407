"""Learned skills as settings and messages of controllers that others wrote."""
