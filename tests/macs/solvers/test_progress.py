import io
import time
from dataclasses import replace

from terminals import Terminal

from macs.io.console import minutes
from macs.solvers.progress import Progress, SearchDisplay, clock, count


def standing(evaluations: int = 1200, elapsed: float = 12.0, archive: int = 4, **failures: int) -> Progress:
    ideal = {"flight time": 109.1, "speed": 0.9} if archive else {}
    return Progress(evaluations, 10_000, elapsed, archive, ideal, failures, lambda: None)


def test_plain_lines_come_now_and_then_and_at_the_end():
    stream = io.StringIO()
    with SearchDisplay(stream=stream) as display:
        for second in range(25):
            display.update(standing(evaluations=100 * second, elapsed=float(second)))
        display.update(standing(10_000, 25.0, infeasible=3))
    lines = stream.getvalue().splitlines()
    assert len(lines) == 4 and lines[0].startswith("0 / 10 000 evaluations, 0:00, archive 4")
    assert lines[-1] == "10 000 / 10 000 evaluations, 0:25, archive 4, flight time 109.1, speed 0.9, 3 infeasible"
    stream = io.StringIO()
    with SearchDisplay(stream=stream):
        pass
    assert stream.getvalue() == ""
    with SearchDisplay(stream=stream) as display:
        display.update(standing(archive=0))
    assert stream.getvalue() == "1 200 / 10 000 evaluations, 0:12, 100 a second, 1:28 left, no feasible point yet\n"
    stream = io.StringIO()
    with SearchDisplay(stream=stream) as display:
        display.update(replace(standing(10_000), gradient_solves=31))
    assert stream.getvalue().startswith("10 000 / 10 000 evaluations, 0:12, 31 gradient solves, archive 4")
    assert [minutes(s) for s in (0, 59.6, 61, 7205)] == ["0:00", "1:00", "1:01", "2:00:05"]
    assert clock(standing(0)) == "0:12" and clock(standing(5000)) == "0:12, 417 a second, 0:12 left" and clock(standing(10_000)) == "0:12"
    assert count(standing()) == "1 200 / 10 000 evaluations"


def test_a_terminal_sees_it_live():
    stream = Terminal()
    with SearchDisplay(stream=stream) as display:
        display.update(standing(failed=2))
        time.sleep(0.3)
    shown = stream.getvalue()
    assert "1 200 / 10 000" in shown and "flight time 109.1" in shown and "2 failed" in shown
