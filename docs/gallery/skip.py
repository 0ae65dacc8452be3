r"""Skip entry

A winged vehicle at 79 km dives to 51.88 km, flies level there, and returns to 79 km with the help of its engine. Terminal mass and
terminal speed are to be large, within limits of heating rate, dynamic pressure and load factor. Bae, Shin, Savvaris and Tsourdos,
"Multi-objective skip trajectory optimization for hypersonic reentry vehicles", Cranfield University; the specific impulse, which
the paper leaves out, is chosen.
"""

from macs import sweep
from problems import load

front = sweep(load("skip"), points=6, starts=1)
print(front.table())
front.plot(marked=[0, 3, 5])
front.plot_trajectories([0, 3, 5])

# What was learned
#
# Speed is bought with propellant, nearly evenly along the front: from point #5, which burns hardly any, to #0, which leaves at
# the initial speed. All of it is burned at full thrust after the lowest point, where the dynamic pressure is at its limit on all
# three flights; the load factor touches its limit on the way there, and the heating rate stays far below. Point #5 takes another
# way down than the others: many descents lead to the same pass at the lowest point, and a solve keeps the one it comes upon. All
# points are verified. Six points took 14 gradient solves.
