"""Power: how many people and trials a study needs, told before the first person comes."""
