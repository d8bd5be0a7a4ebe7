"""Proofs that there is no plan: tips that no arm reaches, angles none can spare."""
