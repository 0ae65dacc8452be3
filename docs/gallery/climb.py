r"""Minimum time to climb

A supersonic aircraft is to climb from the runway to 65,600 ft, there to fly level at 968 ft/s, in the least time. Air, lift, drag
and thrust are tables. Bryson, Desai and Hoffman, "Energy-state approximation in performance optimization of supersonic aircraft",
Journal of Aircraft 6(6), 1969, airplane 2. The optimum depends on how the tables are interpolated, in the third digit; here this is
as in YAPSS.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/climb"))
print(best.alone().table())
known = published("climb")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# The aircraft accelerates near the ground, climbs, dives a little to gain speed through the sound barrier, and pulls up at the end: a
# climb is not steep all along. The time is 320.48 s, 0.02 s more than in YAPSS; a comparison in the fourth digit depends on how tables
# are interpolated. The costates of altitude and path angle are rough in the first seconds, where the altitude is on its lower bound
# and the path angle has to follow it.
