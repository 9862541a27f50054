"""How a session goes: study, plan, trial engine, participant and record."""
