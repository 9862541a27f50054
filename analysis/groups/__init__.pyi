from .population import PopulationThreshold, population_thresholds
from .tables import difference_table, group_table

__all__ = ["PopulationThreshold", "difference_table", "group_table", "population_thresholds"]
