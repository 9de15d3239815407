"""What is worth knowing about a hydraulic machine before it runs."""
