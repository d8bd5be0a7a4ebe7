"""python -m vdsm_pin.certificate_checker CERTIFICATE PROBLEM TRAJECTORY."""

import sys

from vdsm_pin.certificate_checker import main

sys.exit(main(sys.argv[1:]))
