"""What the fingertips get: actuators, contact areas, the level at the other finger."""
