"""Generators that speak SCPI."""
