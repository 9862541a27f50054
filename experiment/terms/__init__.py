"""Words and values that everything else in an experiment shares."""
