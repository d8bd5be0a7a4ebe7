"""Its place puts tests/ on the path: helpers shared by test folders live there."""

from vdsm_pin.startup import live_briefly

# Before numpy is imported. Else every worker has a thread for every processor, which
# wait for one another busily: several times the work where matrices are decomposed.
live_briefly()
