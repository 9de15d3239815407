"""Checks of a hydraulic machine before it runs."""
