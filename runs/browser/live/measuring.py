"""The comparison of solvers while a study runs: made anew in a thread of its own, seldom enough not to take the study's time."""

from __future__ import annotations

import time
from typing import Any

from ...report.comparison import comparisons
from ..study_page import across_data, measures_data, tables_data
from .cached_store import CachedStore
from .source import Repeater, Resource

REST = 1.0
SHARE = 10.0
"""While the study runs, the time between two comparisons is at least so many times what the last one took."""


class Measuring:
    """Indicators, attainment surfaces, convergence and tables of the finished runs."""

    def __init__(self) -> None:
        self.resource = Resource.of({"comparisons": {}, "tables": [], "finished": 0, "trouble": ""})
        self._store: CachedStore | None = None
        self._key: Any = None
        self._measured: Any = None
        self._busy, self._ended, self._took = False, 0.0, 0.0
        self._repeater = Repeater(self._measure, REST)

    def want(self, store: CachedStore, key: Any, busy: bool) -> None:
        """Ask for the comparison of what is in the store; it is made again if the key differs. `busy`: the study runs."""
        self._store, self._key, self._busy = store, key, busy
        if key != self._measured:
            self._repeater.want()

    def _measure(self) -> None:
        store, key = self._store, self._key
        if store is None or key == self._measured or (self._busy and time.monotonic() - self._ended < SHARE * self._took):
            return
        began = time.monotonic()
        summary = store.summary()
        try:
            found = comparisons(store, {}) if summary.finished else []
            data = {f"{one.problem}, {one.transcription}": measures_data(one) | tables_data(one, store.definition) for one in found}
            across = across_data(found, store.definition)
            self.resource = Resource.of({"comparisons": data, **across, "finished": summary.finished, "trouble": ""})
        except (ValueError, OSError) as error:
            self.resource = Resource.of({"comparisons": {}, "tables": [], "finished": 0, "trouble": " ".join(str(error).split())})
        self._measured, self._ended = key, time.monotonic()
        self._took = self._ended - began
