"""Psychometric functions: fits, posteriors, groups, levels placed."""
