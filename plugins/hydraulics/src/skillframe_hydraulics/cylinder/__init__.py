"""The hydraulic cylinder: its equations, their integration, and banks of cylinders."""
