"""What came out: checked trials, detection probabilities, figures."""
