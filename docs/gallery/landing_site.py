r"""Landing sites on rough ground

Three landers fly for 40 s and come to rest wherever they like. The farther, the more effort; far away there is a plain, where the
ground is safe, but on the way it is full of hollows, each a trap for searches that follow slopes. The sum of the efforts $\int
|a|^2 \mathrm{d}t$ is minimised against the sum of the hazards of the sites. A case of this project. The true front is known, since
both objectives are plain functions of the sites.
"""

from macs import MACS, sweep
from problems import load
from problems.cases.landing_site import reference

problem = load("landing_site")
front = MACS(agents=20).solve(problem, evaluations=3000, seed=1)
slopes = sweep(problem, points=10, seed=1)  # gradients alone
print(front.table())
print(slopes.table())

some = [0, len(front) // 2, -1]
front.plot(marked=some, beside={"true front": reference(), "sweep by gradients": slopes.objectives})
front.plot_trajectories(some)

# What was learned
#
# Safe ground is far away: the hazard falls by flying farther, and the cheapest steps are the first ones. The true front is in
# many pieces, since each lander ends in a hollow, or in another. In this short run neither way finds all of them: most points of
# both are above the true front, those of the sweep somewhat less. All points are verified, and all are locally optimal: neither
# rules out a better hollow close by. A search needs more than the 3,000 evaluations of this script here.
