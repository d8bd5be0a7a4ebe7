"""Its place puts tests/ on the path: helpers shared by test folders live there."""
