r"""Goddard's rocket

The greatest height that a rocket with drag can reach with a given propellant:

$$\dot h = v, \quad \dot v = \frac{T - D(h, v)}{m} - \frac{1}{h^2}, \quad \dot m = -\frac{T}{c}, \quad 0 \le T \le 3.5$$

Goddard, "A method of reaching extreme altitudes", 1919; problem 10 of Dolan, Moré and Munson, COPS 3.0, 2004, in units of the
earth's radius, the initial mass and the weight there. Height is from the centre of the earth.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/rocket"))
print(best.alone().table())
known = published("rocket")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# Full thrust, then less along a singular arc, where thrust balances drag and weight, then none. Elements end where the arcs do,
# and the thrust is smooth on the singular one, though the objective hardly depends on it there: the height is the best that is
# known, to 2e-8. The Hamiltonian is 0, as the time is free.
