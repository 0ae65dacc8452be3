"""Well-known optimal control problems with complete data, and their published optima: `load("standard/bryson_denham")`.

The folders are kinds of problems: the best of `curves`, `smooth` controls, active state and mixed constraints in `paths`, bang-bang and
singular controls in `switching`, several `phases`. They are no part of a problem's name. Each module has `problem(**data) -> Problem` and
`PUBLISHED`, a tuple of `Published`: the optimum for the default data first, then those for other data, if there are any. `published(name)`
finds them, and `macs bench standard` compares them with ours. No transcription is named here. Where a statement has no bounds for a state
or control, ours are so wide that they do not act, except where a module says otherwise. To add a problem, write its module and its line in
`collection.py`.
"""

from .collection import ROOMS, cases, published
from .published import SHARE, Published

__all__ = ["ROOMS", "SHARE", "Published", "cases", "published"]
