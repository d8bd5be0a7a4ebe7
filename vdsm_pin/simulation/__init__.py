"""The arm in closed loop: rigid links, elastic cables, motors, encoders, a controller.

Section 7 of the paper as a simulation. `settings` says what is assumed, `plant` makes
the multibody for MuJoCo, `time_law` says when the motion is where, `feed_forward` which
tensions hold the arm, `closed_loop` runs it. Nothing is judged here: the executed
motion is a trajectory that `vdsm verify` takes.
"""
