"""Which joint states of a bag a supervisor received, and when: its published states tell it.

At high rates, and where a recorder lost some, not every sample has a state. The supervisor counted its samples, so it
is known how many it received between two states. They are the newest of those that lie between the two in the bag: it
skips older samples for newer ones. Their times are taken between those of the two states.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable

from irsbot_msgs_py.records import JointSample, SingularityState
from irsbot_supervisor.replay.recording import SupervisorSession


class Received:
    """The joint states of a bag, each of which is given to one supervisor."""

    def __init__(self, samples: Iterable[JointSample]) -> None:
        self._samples = list(samples)
        self._waiting: dict[int, deque[int]] = defaultdict(deque)  # rows that nobody has received, by stamp
        for row, sample in enumerate(self._samples):
            self._waiting[sample.stamp_ns].append(row)
        self.between = 0
        """Samples without a state that were given away."""

    @property
    def left(self) -> int:
        """Joint states that no supervisor has received."""
        return sum(len(rows) for rows in self._waiting.values())

    def of(self, session: SupervisorSession) -> dict[int, JointSample]:
        """The samples that a supervisor received, with its numbers and times, in their order."""
        found: dict[int, JointSample] = {}
        last: tuple[SingularityState, int] | None = None
        for state in session.states:
            rows = self._waiting[state.stamp_ns]
            if not rows:
                continue
            row = rows.popleft()
            if last is not None and 1 < state.sequence - last[0].sequence <= row - last[1]:
                found.update(self._between(*last, state, row))
            found[state.sequence] = self._samples[row]._replace(received_ns=state.received_ns, seen_ns=state.seen_ns)
            last = state, row
        return found

    def _between(
        self, first: SingularityState, first_row: int, second: SingularityState, second_row: int
    ) -> dict[int, JointSample]:
        """The samples between two states, if nobody else has received them. Their ages on arrival lie between those of
        the two."""
        numbers = range(first.sequence + 1, second.sequence)
        rows = range(second_row - len(numbers), second_row)
        if any(row not in self._waiting[self._samples[row].stamp_ns] for row in rows):
            return {}
        found, seen_ns = {}, first.seen_ns
        ages = [state.seen_ns - state.stamp_ns for state in (first, second)]
        for number, row in zip(numbers, rows, strict=True):
            sample = self._samples[row]
            self._waiting[sample.stamp_ns].remove(row)
            age_ns = ages[0] + (ages[1] - ages[0]) * (row - first_row) // (second_row - first_row)
            seen_ns = min(max(seen_ns, sample.stamp_ns + age_ns), second.seen_ns)
            received_ns = first.received_ns + seen_ns - first.seen_ns
            found[number] = sample._replace(received_ns=received_ns, seen_ns=seen_ns)
        self.between += len(found)
        return found
