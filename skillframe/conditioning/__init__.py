"""Conditioning of wrenches: Kalman filter and smoother, noise figures from data, bias and tool weight."""
