"""Its place puts tests/ on the path: helpers shared by test folders live there."""

from vdsm_pin.startup import live_briefly

# Before numpy is imported. Else every worker has a thread for every processor, which
# wait for one another busily: several times the work where matrices are decomposed.
live_briefly()

import pytest  # noqa: E402


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks of a batch are done where it runs: no process is started for them."""
    import vdsm_pin.batch.run as run_module
    from vdsm_pin.batch.pool import Ended
    from vdsm_pin.batch.worker import perform

    def done_here(_: object, tasks: list) -> object:
        return (Ended(task, perform(task), "done") for task in tasks)

    monkeypatch.setattr(run_module, "_all_ended", done_here)
