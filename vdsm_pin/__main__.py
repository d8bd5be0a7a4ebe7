"""`python -m vdsm_pin` is `vdsm`."""

from vdsm_pin.cli import main

if __name__ == "__main__":
    main()
