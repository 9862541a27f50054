"""Plates with patches: functions that bend at their rims, matrices, modes."""
