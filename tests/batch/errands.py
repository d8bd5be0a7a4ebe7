"""Errands for worker processes; importable by a spawned process."""

import os
import signal
import time


def errand(word: str) -> str:
    if word == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if word == "leave":
        os._exit(7)
    if word == "hang":
        time.sleep(600.0)
    if word == "eat":
        food = [bytearray(1 << 24) for _ in range(16)]
        time.sleep(600.0)
        return str(len(food))
    return word + ", " + os.environ["OMP_NUM_THREADS"]
