"""A trial: drawn, planned, sealed, and led from cue to answer by the engine."""
