r"""Space manoeuvre vehicle

A skip like that of [skip](skip.md) over a turning planet, down to 50 km, with four objectives: flight time, heat load, terminal
speed and terminal mass. Angle of attack, bank angle and thrust follow their commands with a lag. Chai, Savvaris, Tsourdos and Xia,
"An interactive fuzzy physical programming for solving multiobjective skip entry problem", IEEE Transactions on Aerospace and
Electronic Systems 53(5), 2017; what it leaves out is chosen.
"""

from macs import Front, optimize
from macs.decisions import Ranges, ReferencePoint, decide
from problems import load
from transcription import stated

problem = load("smv")
mesh = stated(problem.default_transcription)
cool = optimize(problem, mesh, objective="heat load", starts=1)
fast = optimize(problem, mesh, objective="flight time", start=cool.alone(), starts=1)
speed, mass = (optimize(problem, mesh, objective=name, starts=1) for name in ("terminal speed", "terminal mass"))
ends = Front.merge([point.alone() for point in (cool, fast, speed, mass)]).mended()

ranges = Ranges.of(ends)
middle = {"flight time": 500.0, "heat load": 55.0, "terminal speed": 5000.0, "terminal mass": 70e3}
swift = {"flight time": 480.0, "heat load": 55.0, "terminal speed": 7700.0, "terminal mass": 27e3}
between = [decide(problem, mesh, ReferencePoint(hopes), ranges=ranges, start=fast, starts=1).point for hopes in (middle, swift)]
front = Front.merge([ends, *(point.alone() for point in between)])
print(front.table())
some = [0, 2, 4]
front.plot(marked=some)
front.plot_trajectories(some)

# What was learned
#
# The quickest flight, #0, and that of the least heat load, #1, are nearly the same: one dive on its side, at the limits of load factor
# and heating rate, and up with full thrust from the lowest point on. #4 saves propellant: it rises four times on its way down, and
# burns for a few seconds only, so that it keeps 86456.8 kg. At the lowest point, the dynamic pressure is at its limit on all three
# flights that are drawn. An optimum of one objective may be poor in all others: #5 has the greatest speed that is allowed, as many
# flights have, and #2, found from hopes for all four objectives, has 7743.03 m/s and is far better in the rest. Where a solve begins
# decides what it finds: #0 is the optimum from #1, and from the guess of the case a slower flight was found. Without a transcription
# a mesh would be sought, which takes longer; that of the case does for all but #4, which `mended()` moved inside the limit that it
# exceeded between nodes.
