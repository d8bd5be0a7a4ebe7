"""Rechecks certificates in ball arithmetic: a program of its own.

Read `claims.py` first: it recomputes every claim. `motion.py` bounds how far bodies
reach, `solids.py` how near the obstacles come. `arm.py` says what the files of a snake
arm ask about, `robot.py` those of any robot; `rows.py` judges the rows of both, with
`path.py` for what an arm's tip draws. `program.py` says the verdict, `balls.py` has
vectors of balls.
"""

from vdsm_pin.certificate_checker.program import Outcome, check_certificate, main

__all__ = ["Outcome", "check_certificate", "main"]
