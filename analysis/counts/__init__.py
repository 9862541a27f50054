"""What was answered: trials that count, proportions, intervals, choices, effects of order."""
