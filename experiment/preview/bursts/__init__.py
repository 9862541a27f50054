"""Bursts on a study's plate, compared with the edges that it states and with the other ideal."""
