"""CasADi's way to the accelerations of a robot: symbols through the recursions, common subexpressions, its C code."""

from __future__ import annotations

from typing import Any

from .spatial import Body, Matrix, Tree, Vector, add, apply, dot, product, rotated, scale, skew, subtract, transpose

GRAVITY = 9.81


def bodies_of(model: Any) -> list[Body]:
    """The bodies of a Pinocchio model whose joints are all revolute about axes of their frames."""

    def exact(x: float) -> float:
        return float(round(x)) if abs(x - round(x)) < 1e-9 else float(x)

    found = []
    for i in range(1, model.njoints):
        place, inertia = model.jointPlacements[i], model.inertias[i]
        kind = model.joints[i].shortname()
        assert kind.startswith("JointModelR") and kind[-1] in "XYZ", kind  # noqa: PT018
        rotation = [[exact(x) for x in row] for row in place.rotation]
        found.append(
            Body(
                model.parents[i] - 1,
                "XYZ".index(kind[-1]),
                rotation,
                [exact(x) for x in place.translation],
                float(inertia.mass),
                inertia.lever.tolist(),
                inertia.inertia.tolist(),
            )
        )
    return found


def bias(tree: Tree, gravity: Vector) -> Vector:
    """Forces that hold the velocities, by the recursive Newton-Euler algorithm."""
    A, wrenches = [], []
    inertias = tree.inertias()
    for i, inertia in enumerate(inertias):
        A.append(tree.accelerate(i, A, gravity))
        n, f = tree.wrench(inertia, *A[i])
        pn, pf = tree.product_wrench(i, inertia)
        wrenches.append((add(n, pn), add(f, pf)))
    forces = [tree.zero] * len(inertias)
    for i in reversed(range(len(inertias))):
        n, f = wrenches[i]
        forces[i] = n[tree.bodies[i].axis]
        p = tree.bodies[i].parent
        if p >= 0:
            moved = tree.shifted(i, n, f)
            wrenches[p] = add(wrenches[p][0], moved[0]), add(wrenches[p][1], moved[1])
    return forces


def mass_matrix(tree: Tree) -> Matrix:
    """By composite bodies."""
    n = len(tree.bodies)
    M = [[tree.zero] * n for _ in range(n)]
    composite = tree.inertias()
    for i in reversed(range(n)):
        b, E, r = tree.bodies[i], tree.E[i], tree.r[i]
        m, h, I = composite[i]
        if b.parent >= 0:
            h2, I2 = apply(E, h), rotated(E, I)
            d = 2 * dot(h2, r) + m * dot(r, r)
            M0, H0, I0 = composite[b.parent]
            moved = [[tree.zero] * 3 for _ in range(3)]
            for a in range(3):
                for c in range(a, 3):
                    off = h2[a] * r[c] + r[a] * h2[c] + m * (r[a] * r[c])
                    moved[a][c] = moved[c][a] = I0[a][c] + (I2[a][c] + (d if a == c else 0.0) - off)
            composite[b.parent] = M0 + m, add(H0, add(h2, scale(m, r))), moved
        axis = [tree.one if k == b.axis else tree.zero for k in range(3)]
        moment, force = tree.wrench(composite[i], axis, [tree.zero] * 3)
        M[i][i] = moment[b.axis]
        j = i
        while tree.bodies[j].parent >= 0:
            moment, force = tree.shifted(j, moment, force)
            j = tree.bodies[j].parent
            M[i][j] = M[j][i] = moment[tree.bodies[j].axis]
    return M


def solve(tree: Tree, M: Matrix, b: Vector) -> Vector:
    """M^-1 b by L D L^T."""
    n = len(b)
    L = [[tree.zero] * n for _ in range(n)]
    D = [tree.zero] * n
    for j in range(n):
        weighted = [L[j][k] * D[k] for k in range(j)]
        D[j] = M[j][j]
        for k in range(j):
            D[j] = D[j] - L[j][k] * weighted[k]
        inverse = 1 / D[j]
        for i in range(j + 1, n):
            t = M[i][j]
            for k in range(j):
                t = t - L[i][k] * weighted[k]
            L[i][j] = t * inverse
    y = list(b)
    for i in range(n):
        for k in range(i):
            y[i] = y[i] - L[i][k] * y[k]
    x = [a / d for a, d in zip(y, D, strict=True)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = x[i] - L[k][i] * x[k]
    return x


def articulated(tree: Tree, tau: Vector, gravity: Vector) -> Vector:
    """Accelerations by articulated bodies; inertias are blocks [[I, H], [H^T, M]]."""
    zero, inertias, n = tree.zero, tree.inertias(), len(tree.bodies)
    blocks = [(I, skew(h, zero), [[m if a == c else zero for c in range(3)] for a in range(3)]) for m, h, I in inertias]
    bias_wrenches = [tree.product_wrench(i, inertia) for i, inertia in enumerate(inertias)]
    columns: list[Any] = [None] * n
    for i in reversed(range(n)):
        k, (I, H, M), (pn, pf) = tree.bodies[i].axis, blocks[i], bias_wrenches[i]
        Un, Uf = [I[a][k] for a in range(3)], [H[k][a] for a in range(3)]
        inverse, u = 1 / Un[k], tau[i] - pn[k]
        columns[i] = Un, Uf, inverse, u
        p = tree.bodies[i].parent
        if p < 0:
            continue
        Vn, Vf, s = scale(inverse, Un), scale(inverse, Uf), inverse * u
        Ia, Ma = [[zero] * 3 for _ in range(3)], [[zero] * 3 for _ in range(3)]
        for a in range(3):
            for c in range(a, 3):
                Ia[a][c] = Ia[c][a] = zero if k in (a, c) else I[a][c] - Un[a] * Vn[c]
                Ma[a][c] = Ma[c][a] = M[a][c] - Uf[a] * Vf[c]
        Ha = [[zero if a == k else H[a][c] - Un[a] * Vf[c] for c in range(3)] for a in range(3)]
        cw, cv = tree.cw[i], tree.cv[i]
        pn = add(add(pn, add(apply(Ia, cw), apply(Ha, cv))), scale(s, Un))
        pf = add(add(pf, add(apply(transpose(Ha), cw), apply(Ma, cv))), scale(s, Uf))
        E, rx = tree.E[i], skew(tree.r[i], zero)
        Ir, Mr, Hr = rotated(E, Ia), rotated(E, Ma), product(product(E, Ha), transpose(E))
        Hp = [add(x, y) for x, y in zip(Hr, product(rx, Mr), strict=True)]
        A1, A2 = product(Hp, rx), product(rx, transpose(Hr))
        Ip = [[zero] * 3 for _ in range(3)]
        for a in range(3):
            for c in range(a, 3):
                Ip[a][c] = Ip[c][a] = Ir[a][c] + A2[a][c] - A1[a][c]
        blocks[p] = tuple(  # type: ignore[assignment]
            [add(x, y) for x, y in zip(A, B, strict=True)] for A, B in zip(blocks[p], (Ip, Hp, Mr), strict=True)
        )
        moved = tree.shifted(i, pn, pf)
        bias_wrenches[p] = add(bias_wrenches[p][0], moved[0]), add(bias_wrenches[p][1], moved[1])
    found, A = [], []
    for i in range(n):
        (w, v), (Un, Uf, inverse, u) = tree.accelerate(i, A, gravity), columns[i]
        found.append(inverse * (u - (dot(Un, w) + dot(Uf, v))))
        spin = [found[i] if k == tree.bodies[i].axis else zero for k in range(3)]
        A.append((add(w, spin), v))
    return found


def casadi_source(model: Any) -> tuple[str, int]:
    """C text of ``void accelerations(q, v, tau, out)`` from the form with fewer operations, and how many these are."""
    import casadi as ca

    n = model.nv
    q, v, tau = (ca.SX.sym(name, n) for name in ("q", "v", "tau"))
    bodies = bodies_of(model)
    up = [ca.SX(0), ca.SX(0), ca.SX(GRAVITY)]
    forms = []
    for form in ("articulated", "factor"):
        tree = Tree(bodies, [q[i] for i in range(n)], [v[i] for i in range(n)], ca.sin, ca.cos, ca.SX)
        forces = [tau[i] for i in range(n)]
        if form == "articulated":
            found = articulated(tree, forces, up)
        else:
            found = solve(tree, mass_matrix(tree), subtract(forces, bias(tree, up)))
        f = ca.Function("f", [q, v, tau], [ca.densify(ca.vertcat(*found))], {"cse": True})
        idle = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST)
        count = sum(f.instruction_id(k) not in idle for k in range(f.n_instructions()))
        forms.append((count, f))
    count, f = min(forms, key=lambda form: form[0])
    generator = ca.CodeGenerator("f", {"with_header": False})
    generator.add(f)
    text = generator.dump() + (
        "void accelerations(const double *q, const double *v, const double *tau, double *out)\n{\n"
        f"    double w[{max(1, f.sz_w())}];\n    const double *arg[8] = {{ q, v, tau }};\n"
        "    double *res[8] = { out };\n    f(arg, res, 0, w, 0);\n}\n"
    )
    return text, count
