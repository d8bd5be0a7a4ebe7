"""What a command goes without, since it lives for a second or two.

Together this is a fifth of the time of `vdsm plan`. Only the command line asks for it:
whoever imports the package decides for himself.
"""

import atexit
import gc
import os
from typing import Final

SETTINGS: Final = {
    # numpy starts a thread for every processor; our matrices are too small to share.
    "OPENBLAS_NUM_THREADS": "1",
    # pydantic looks for plugins in every package that is installed.
    "PYDANTIC_DISABLE_PLUGINS": "__all__",
}
"""Environment variables, where the user has not set them."""

OBJECTS: Final = 100_000
"""New objects between two searches for garbage in cycles; Python searches after 700,
over and over while modules are being imported, and finds nothing."""


def live_briefly() -> None:
    """Settle this before numpy and pydantic are imported."""
    for name, value in SETTINGS.items():
        os.environ.setdefault(name, value)
    gc.set_threshold(OBJECTS)
    # What is left at the end goes with the process; Python would search it thrice.
    atexit.register(gc.freeze)
