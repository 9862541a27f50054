"""How many participants and trials a study needs, and which levels a participant gets."""
