"""HRM-1000: a thousand seeded planning problems for hyper-redundant arms, by family."""
