"""Signals in the loop: delay lines, rate filters and Kalman filters."""
