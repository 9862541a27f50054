"""What came out: every burst measured at a tap, matched against what was planned, and judged."""
