r"""Space manoeuvre vehicle

A skip like that of [skip](skip.md) over a turning planet, down to 50 km, with four objectives: flight time, heat load, terminal
speed and terminal mass. Angle of attack, bank angle and thrust follow their commands with a lag. Chai, Savvaris, Tsourdos and Xia,
"An interactive fuzzy physical programming for solving multiobjective skip entry problem", IEEE Transactions on Aerospace and
Electronic Systems 53(5), 2017; what it leaves out is chosen.
"""

from macs import MACS
from problems import load

front = MACS().solve(load("smv"), seed=1)
print(front.table())
some = [0, 4, 6, 9]
front.plot(marked=some)
front.plot_trajectories(some)

# What was learned
#
# One call with defaults gives ten verified points, spread in all four objectives. All flights that are drawn dive on their side, at the
# limits of load factor and heating rate, and meet that of the dynamic pressure at the lowest point; what follows decides. #0, the
# quickest, goes up steeply with full thrust; #6 burns longest, and leaves with the greatest speed that is allowed; #9 burns for some
# seconds only, keeps 86447 kg, and has turned to the other side on its way down. #4 is a compromise. Speed is bought with propellant:
# the lines of speed and mass cross. The heat load differs by a tenth only. Ends of this front give up a little of their own objective
# for much in others: a flight that keeps a little more mass than #9 is known, which takes far longer, with far more heat. Points are
# local optima: a quicker flight than #0 is known, too.
