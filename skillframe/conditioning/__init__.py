"""Kalman filtering and smoothing of wrenches, and identification of bias and tool weight."""
