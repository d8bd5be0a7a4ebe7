"""The proof: convex bodies on any tree of joints held apart over continuous time.

`Question.of(tree, bodies, pairs, errors).about(path, budget).prove()` is a `Proof`. If
the verdict of a pair is CERTIFIED, then at every instant of the path and for every
motion within the error box its two bodies keep their required clearance, rounding
included. If it is REFUTED, two points, one of each body, come nearer at a stated time.

Imports numpy and `geometry/` only (a test holds it): it knows no files and no problem.
`docs/certificate.md` has the bound.
"""
