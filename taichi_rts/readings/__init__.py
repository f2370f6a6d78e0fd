"""What a state says: measures, extremes, levels, and what is wrong with it."""
