"""Methods as users write them: words of the command line, settings, meshes, files; and what is no method, in the user's words."""

import json
import pickle

import numpy as np
import pytest
from cases import oscillator
from euler import Euler

from problems import load
from transcription import DFET, Collocation, MultipleShooting, SingleShooting, Smooth, from_dict, parse, word
from transcription.inner import Auto, Ipopt, Newton
from transcription.phases.mesh import PhaseMesh

UNEVEN = (0.0, 0.1, 0.35, 0.9, 1.0)
WORDS = {
    "dfet:4x6": DFET(4, 6),
    "dfet:4x6:bernstein": DFET(4, 6, basis="bernstein"),
    "dfet:40x2:bernstein:1": DFET(40, 2, control_order=1, basis="bernstein"),
    "radau:10x4": Collocation(10, 4),
    "chebyshev:1x60": Collocation(1, 60, points="chebyshev"),
    "lobatto:8x4:bernstein:1": Collocation(8, 4, points="lobatto", control="bernstein", control_order=1),
    "gauss:3x2:0": Collocation(3, 2, points="gauss", control_order=0),
    "shooting:200": SingleShooting(200),
    "shooting:20x4:spline:5:rk8": SingleShooting(20, steps=4, scheme="rk8", control="spline", control_nodes=5),
    "multiple-shooting:40x2:heun": MultipleShooting(40, steps=2, scheme="heun"),
}


@pytest.mark.parametrize("text", WORDS)
def test_words_and_plain_data_give_the_same_method_back(text):
    method = WORDS[text]
    assert parse(text) == parse(text.capitalize()) == method and word(method) == text
    again = from_dict(json.loads(json.dumps(method.to_dict())))
    assert again == method == pickle.loads(pickle.dumps(method)) == eval(repr(method)) and hash(again) == hash(method)


@pytest.mark.parametrize(
    "method",
    [
        SingleShooting(9, path_points=1),
        DFET(2, 3, mesh={"swing": (UNEVEN, 3)}),
        DFET(2, 3, mesh={"a": ((0, 1), 2), "b": (UNEVEN, 0)}),
        DFET(2, 3, mesh=[("a", PhaseMesh(UNEVEN, 3, np.int64(1), [3, np.int64(1)], {"u": [1, 0], "v": (2,)}))]),
        Collocation(3, 4, mesh={"a": ([0.0, 0.3, 1.0], 5, 2, [1])}),
        MultipleShooting(3, steps=2, mesh={"run": (UNEVEN, 4), "a": [(0.0, 0.3, 1.0), 4]}),
    ],
)
def test_what_has_no_word_goes_through_files(method):
    again = from_dict(json.loads(json.dumps(method.to_dict())))
    assert again == method and hash(again) == hash(method) and word(method) is None and again.to_dict() == method.to_dict()


def test_files_from_before_meshes():
    assert from_dict({"method": "MultipleShooting", "settings": {"intervals": 3}}) == MultipleShooting(3)
    assert DFET(2, 3, mesh={}) == DFET(2, 3) and word(MultipleShooting(3, mesh={})) == "multiple-shooting:3"


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        (DFET(4, 6, basis="bernstein", control_order=0), "DFET(elements=4, order=6, control_order=0, basis='bernstein')"),
        (Smooth(spread=0.3), "Smooth(spread=0.3)"),
        (Auto(), "Auto()"),
        (Newton(max_iterations=7), "Newton(max_iterations=7)"),
        (Ipopt(objective="constant"), "Ipopt(objective='constant')"),
        (DFET(4, 6, mesh={"a": PhaseMesh.uniform(40, 3)}), "DFET(elements=4, order=6, mesh=(('a', PhaseMesh(40 elements of order 3)),))"),
        (PhaseMesh(UNEVEN, 3, 1, (1, 3)), "PhaseMesh(4 elements of order 3, controls of order 1, 2 of 3 inner edges moving)"),
    ],
)
def test_settings_show_what_differs_from_their_defaults(settings, text):
    assert repr(settings) == text


def swing(*mesh: object) -> DFET:
    return DFET(2, 3, mesh={"swing": mesh})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        *(
            (lambda text=text: parse(text), "unknown transcription")
            for text in ("", "dfet", "dfet:4x", "dfet:-4x6", "rk:4x6", "shooting:a")
        ),
        *(
            (lambda text=text: parse(text), "write it as")
            for text in ("dfet:4", "dfet:4x6x7", "dfet:4x6:1:2", "radau:4", "radau", "shooting")
        ),
        (lambda: parse("dfet:4x6:hermite"), r"'hermite' is none of its words \(lobatto, bernstein\); write it as dfet"),
        (lambda: parse("radau:4x3:lobatto"), "'lobatto': points is given twice; write it as radau"),
        (lambda: parse("shooting:20:cubic"), r"'cubic' is none of its words \(constant, linear, spline; .*rk4.*; write it as shooting"),
        (lambda: parse("shooting:20:linear:spline"), "'spline': control is given twice; write it as shooting"),
        (lambda: from_dict({"method": "Magic"}), "Magic"),
        (lambda: from_dict({"method": "DFET", "settings": {"stages": 3}}), "transcription DFET"),
        (lambda: DFET(0, 1), "DFET: elements must be a whole number of at least 1, not 0"),
        (lambda: DFET(1, 1.0), "DFET: order"),
        (lambda: DFET(1, 1, -1), "DFET: control_order"),
        (lambda: DFET(1, 1, None, "hermite"), "DFET: basis must be"),
        (lambda: Collocation(2, 0), "Collocation: degree must be a whole number of at least 1, not 0"),
        (lambda: Collocation(2, 3, points="hermite"), "Collocation: points must be .*radau.*hermite"),
        (lambda: Collocation(2, 3, control_order=3), "control_order is 3, but 3 radau points determine no more than degree 2"),
        (lambda: Collocation(2, 3, mesh={"a": ([0, 1], 2, 2)}), "phase 'a': the order of the controls is 2, but 2 radau points"),
        (lambda: SingleShooting(1), "SingleShooting: nodes must be a whole number of at least 2, not 1"),
        (lambda: MultipleShooting(True), "MultipleShooting: intervals must be a whole number of at least 1, not True"),
        (lambda: MultipleShooting(3, steps=0), "MultipleShooting: steps must be a whole number of at least 1, not 0"),
        (lambda: SingleShooting(9, control_nodes=1), "SingleShooting: control_nodes must be a whole number of at least 2, not 1"),
        (lambda: SingleShooting(9, scheme="rk5"), "SingleShooting: scheme must be one of 'euler'.*, not 'rk5'"),
        (lambda: MultipleShooting(3, mesh={"swing": (UNEVEN, 2)}), "phase 'swing': on a mesh for rk4 the order is 4, not 2"),
        (lambda: MultipleShooting(3, mesh={"swing": (UNEVEN, 4, 2)}), "phase 'swing': the order of its controls cannot be chosen"),
        (lambda: Euler(3, mesh={"swing": (UNEVEN, 1, None, (2,))}), "Euler: phase 'swing': the edges of its elements cannot move"),
        (lambda: DFET(2, 3, mesh={"swim": (UNEVEN, 2)}).transcribe(oscillator()), "phase 'swim'; the phases of 'oscillator' are swing"),
        (lambda: swing(UNEVEN, 3, 2, (1, 3), {"w": (0,)}).transcribe(oscillator()), "no control 'w'; its controls are u, v"),
        (lambda: Collocation(2, 3, mesh={"a": ([0, 1], 2)}).transcribe(load("goddard")), "a mesh is given for phase 'a'; the phases of"),
        (lambda: DFET(2, 3, mesh=7), "must be a mapping"),
        *(
            (lambda mesh=mesh: swing(*mesh), "DFET: phase 'swing'")
            for mesh in (
                ((0, 0.5), 2),
                ((0, 0.7, 0.5, 1), 2),
                ((0, np.nan, 1), 2),
                ((0, 0.5, 0.5 + 1e-12, 1), 2),
                ((0, 1), -1),
                (0, 1),
                ("ab", 1),
                (UNEVEN, 2, 1.5),
                (UNEVEN, 2, 1, (0,)),
                (UNEVEN, 2, 1, (1.0,)),
                (UNEVEN, 2, 1, (True,)),
                (UNEVEN, 2, 1, (1, 2, 1)),
                (UNEVEN, 2, 1, "12"),
                (UNEVEN, 3, 2, (1, 3), 3),
                (UNEVEN, 3, 2, (1, 3), {"u": (3,)}),
                (UNEVEN, 3, 2, (1, 3), {"u": (0, 0)}),
            )
        ),
    ],
)
def test_what_is_no_method_is_refused_in_the_users_words(make, message):
    with pytest.raises(ValueError, match=message):
        make()
