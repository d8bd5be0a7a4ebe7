"""The proof itself, in compiled code: convex bodies held apart over slices of time.

Imports numpy and `geometry/` only (a test holds it): it knows no files and no problem.
`docs/certificate.md` has the bound.
"""
