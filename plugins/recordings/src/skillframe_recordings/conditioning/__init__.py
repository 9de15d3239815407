"""Wrench conditioning: filters, noise figures, bias and tool weight."""
