"""What simulated participants perceive: gains at the fingertips, thresholds and answers."""
