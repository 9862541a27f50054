"""A session in progress: the effects of the trial engine carried out, begun or resumed."""
