"""The plate over time as oscillators: its modes, each driven by the loads, and a static rest."""
