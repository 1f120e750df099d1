"""Stage program: SystemTerms -> the symbols of each port, a named group of numbers that functions take."""

from __future__ import annotations

from collections.abc import Mapping

from .terms import SystemTerms


def port_symbols(terms: SystemTerms, n_h: int) -> Mapping[str, tuple[str, ...]]:
    """Symbols by the name of the port; n_h holonomic rows have corrections."""
    independent, coordinate_of = terms.preferred, terms.coordinate_of
    return {
        "q": terms.q,
        "v": terms.v,
        "a": terms.a,
        "q_i": tuple(terms.q[coordinate_of[i]] for i in independent if i < terms.n_v - terms.n_states),
        "v_i": tuple(terms.v[i] for i in independent),
        "a_i": tuple(terms.a[i] for i in independent),
        "q_guess": tuple(f"guess({q})" for q in terms.q),
        "multipliers": terms.multipliers,
        "z": terms.system.unknowns if terms.system else (),
        "corrections": tuple(f"correction[{i}]" for i in range(n_h)),
        "q_rate": tuple(f"rate({q})" for q in terms.q),
        "multiplier_rates": tuple(f"rate({l})" for l in terms.multipliers),
        "correction_rates": tuple(f"rate(correction[{i}])" for i in range(n_h)),
        "cj": ("cj",),
        "impulses": tuple(f"impulse[{i}]" for i in range(len(terms.events))),
        "held_impulses": tuple(f"held_impulse[{i}]" for i in range(len(terms.held_errors) // 2)),
        "dq": tuple(f"d({q})" for q in terms.q),
        "dv": tuple(f"d({v})" for v in terms.v),
        "du": tuple(f"d({u})" for u in terms.u),
        "dp": tuple(f"d({p})" for p in terms.p),
        "da": tuple(f"d({a})" for a in terms.a),
    }
