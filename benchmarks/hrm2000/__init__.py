"""HRM-2000: planning problems that are known to be feasible, each with a witness."""
