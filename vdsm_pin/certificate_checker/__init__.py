"""Rechecks certificates in ball arithmetic: a program of its own, below 860 lines.

Read `claims.py` first: it recomputes every claim. `motion.py` bounds how far the arm
reaches, `solids.py` how near the obstacles come, `path.py` what the tip draws;
`program.py` reads the files and says the verdict, `balls.py` has vectors of balls.
"""

from vdsm_pin.certificate_checker.program import Outcome, check_certificate, main

__all__ = ["Outcome", "check_certificate", "main"]
