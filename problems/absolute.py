"""Terms of an expression, and absolute values and norms among those of an integrand.

An integral is linear: where an integrand is a sum of terms, each absolute value or root among them has an integral of its own, and what is
left has another. Whether one of these is minimised, or maximised, can then be decided one by one.
"""

from __future__ import annotations

import casadi as ca

ROOTS = ca.OP_SQRT, ca.OP_NORM2, ca.OP_NORMF
"""Operations that are a norm, or may be one."""


def radicand(node: ca.MX) -> ca.MX | None:
    """The expression of which a node is the square root; None if it is none."""
    if not any(node.is_op(op) for op in ROOTS):
        return None
    return node.dep(0) if node.is_op(ca.OP_SQRT) else ca.sumsqr(node.dep(0))


def absolute_terms(expr: ca.MX) -> list[tuple[float, ca.MX]]:
    """Factors and scalar expressions, the sum of whose products is `expr`: one for each absolute value or root in it, and one for the rest.

    Found are `casadi.fabs(...)` and `casadi.norm_1(...)`, also of vectors that are summed up, `casadi.sqrt(...)` and `casadi.norm_2(...)`,
    in sums, differences and multiples by numbers of any depth. Without one of these, the expression itself is the only term.
    """
    every = terms(expr)
    alone = [any(node.is_op(op) for op in (ca.OP_FABS, *ROOTS)) for _, node in every]
    found, rest = ([term for term, own in zip(every, alone, strict=True) if own is kind] for kind in (True, False))
    if not found:
        return [(1.0, expr)]
    if rest:
        found.append((1.0, sum((_times(*term) for term in rest[1:]), _times(*rest[0]))))
    return found


def branches(expr: ca.MX) -> list[ca.MX]:
    """Expressions of which `expr` is the greatest, for each absolute value, or greater one of two, among its terms; else `expr` itself."""
    found: list[ca.MX] = [ca.MX(0)]
    for factor, node in terms(expr):
        own = [node]
        if factor > 0 and node.is_op(ca.OP_FABS):
            own = [node.dep(0), -node.dep(0)]
        elif factor > 0 and node.is_op(ca.OP_FMAX):
            own = [*branches(node.dep(0)), *branches(node.dep(1))]
        if len(found) * len(own) > 8:
            own = [node]  # as it is: their number doubles with each
        found = [whole + _times(factor, one) for whole in found for one in own]
    return found if len(found) > 1 else [expr]


def terms(expr: ca.MX) -> list[tuple[float, ca.MX]]:
    """Factors and scalar expressions, none of them a sum, the sum of whose products is `expr`."""
    found: list[tuple[float, ca.MX]] = []
    # Not by recursion: sums may have thousands of terms, one inside the other.
    left = [(1.0, expr)]
    while left:
        factor, node = left.pop()
        inner = _terms(node)
        if inner is None:
            found.append((factor, node))
        else:
            left += [(factor * own, part) for own, part in reversed(inner) if own and not part.is_zero()]
    return found


def _terms(node: ca.MX) -> list[tuple[float, ca.MX]] | None:
    """Factors and scalar terms of a sum, or None where an expression is none."""
    parts = [node.dep(i) for i in range(node.n_dep())]
    op = node.op()
    if any(part.shape != (1, 1) for part in parts):
        return _vector_terms(op, parts)
    match op:
        case ca.OP_ADD:
            return [(1.0, parts[0]), (1.0, parts[1])]
        case ca.OP_SUB:
            return [(1.0, parts[0]), (-1.0, parts[1])]
        case ca.OP_NEG:
            return [(-1.0, parts[0])]
        case ca.OP_TWICE:
            return [(2.0, parts[0])]
        case ca.OP_NORM1:
            return [(1.0, ca.fabs(parts[0]))]
        case ca.OP_MUL if parts[0].is_constant():
            return [(float(parts[0]), parts[1])]
        case ca.OP_MUL if parts[1].is_constant():
            return [(float(parts[1]), parts[0])]
        case ca.OP_DIV if parts[1].is_constant() and float(parts[1]):
            return [(1.0 / float(parts[1]), parts[0])]
    return None


def _vector_terms(op: int, parts: list[ca.MX]) -> list[tuple[float, ca.MX]] | None:
    """The same for an operation on vectors: the norm of one, or the product of a row of numbers with absolute values."""
    if op == ca.OP_NORM1:
        return [(1.0, ca.fabs(entry)) for entry in _entries(parts[0])]
    if op not in (ca.OP_MTIMES, ca.OP_DOT):
        return None
    *added, one, other = parts
    for weights, vector in ((one, other), (other, one)):
        if weights.is_constant() and vector.is_op(ca.OP_FABS) and weights.numel() == vector.numel():
            numbers = ca.DM(ca.evalf(ca.densify(weights))).full().ravel().tolist()
            terms = [(number, ca.fabs(entry)) for number, entry in zip(numbers, _entries(vector.dep(0)), strict=True)]
            return [*terms, *((1.0, part) for part in added)]
    return None


def _entries(vector: ca.MX) -> list[ca.MX]:
    """The scalars of a vector."""
    return list(ca.vertsplit(ca.vec(ca.densify(vector))))


def _times(factor: float, expr: ca.MX) -> ca.MX:
    return expr if factor == 1.0 else factor * expr
