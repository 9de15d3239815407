"""The hydraulic machine: its cylinders, its control law, its force estimate, and what is checked before it runs."""
