r"""Car

A car is to go 300 m from rest to rest in the least time. It accelerates by up to 1 m/s² and brakes by up to 2 m/s²:

$$\dot x = v, \quad \dot v = u, \quad -2 \le u \le 1$$

Logsdon and Biegler, "Accurate solution of differential-algebraic optimization problems", Industrial and Engineering Chemistry
Research 28, 1989.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/car"))
print(best.alone().table())
known = published("car")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# Full throttle, then full brakes, with one switch at 20 s: an element of the refined mesh ends there, so that the time is exact. The
# costate of the speed passes through zero at the switch, as Pontryagin's principle asks, and the Hamiltonian is −1 all along, as for
# every least time. The bounds of position and speed do not act; those of the acceleration always do.
