"""The scheme optimal: the cheapest schedule, by linear programs about the flown motion, with its bounds."""
