"""Psychometric functions: likelihoods, fits, posteriors, levels placed."""
