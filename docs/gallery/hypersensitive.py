r"""Hypersensitive

A state is to go from 1.5 to 1 within 50 units of time at the least cost:

$$\dot x = -x^3 + u, \quad \min \int_0^{50} \tfrac12 (x^2 + u^2)\, \mathrm{d}t$$

Rao and Mease, "Eigenvector approximate dichotomic basis method for solving hyper-sensitive optimal control problems", Optimal
Control Applications and Methods 21, 2000. The optimum rests near zero, with a layer at each end, and has a closed form.
"""

from macs import optimize
from problems import load
from problems.cases.standard import published

best = optimize(load("standard/hypersensitive"))
print(best.alone().table())
known = published("hypersensitive")[0]
value = best.simulated[known.objective]
print(f"{known.objective}: simulated {value:.9g}, published {known.value:.9g} ({known.source}); difference {value - known.value:.0e}")
best.plot(costates=True)

# What was learned
#
# All happens in the first and the last few units of time; between, state and control are zero. The mesh is refined where the
# layers are, so that a long rest costs nothing. The cost is 1e-6 above the closed form: the refinement ends once a simulation and
# a finer mesh agree, not at the last digit. The Hamiltonian is zero but for the error of the mesh.
