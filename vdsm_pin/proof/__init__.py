"""The proof: convex bodies on any tree of joints held apart over continuous time.

Imports numpy and `geometry/` only (a test holds it): it knows no files and no problem.
`docs/certificate.md` has the bound.
"""
