"""Rechecks certificates in ball arithmetic: a program of its own.

It shares no code with planner, verifier and their readers, so that an error in them
does not repeat itself here. `claims.py` is the program, `files.py` reads the files,
`solids.py` holds the support functions of the obstacles, `balls.py` vectors of balls.
"""

from vdsm_pin.certificate_checker.claims import Outcome, check_certificate, main

__all__ = ["Outcome", "check_certificate", "main"]
