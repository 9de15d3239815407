"""What a machine's law leaves undone while it cannot tell a force from the stiction of its own pistons.

    D X_r' = T (1 - s / (1 + p)),    T = D X_d' + K (X_d - X) + f + f_ff
    s = a / (1 + a),  a = (sum of (f_i / 2 sigma_i)^2)^2,    p = (sum of (T_i / 1.5 sigma_i)^2)^4

In contact (s = 1) a tool does not set out for an imbalance T that the force's own uncertainty sigma may have made; with
sigma small, or T large, or in the air (s = 0), nothing is left undone. Our choice, because a law that answers every T
never comes to rest: pistons stick, the estimate takes their stiction for force, T turns round, and a crane that pressed
into a corner hunted with 60 to 800 N. The eighth power keeps a slide at 0.1 m/s within 0.1 % of the target dynamics.
"""

from __future__ import annotations

from typing import Any

from skillframe.either import maximum, square_sum

CONTACT, SETTING_OUT = 2.0, 1.5  # sigmas: from where on a force is contact, and an imbalance worth a motion
LEAST = 1e-3  # N, for a force that is known


def left_undone(imbalance: Any, force: Any, sigma: Any) -> Any:
    """Share s / (1 + p) of an imbalance T that is not pursued. Arrays or casadi expressions (`either`).

    Args:
        imbalance: T (..., 2) [N].
        force: on the tool (..., 2) [N].
        sigma: its standard deviation (..., 2) [N].

    Returns:
        (..., 1), from 0 to 1.
    """
    certain = maximum(sigma, LEAST)
    touch = square_sum(force / (CONTACT * certain)) ** 2
    worth = square_sum(imbalance / (SETTING_OUT * certain)) ** 4
    return touch / (1.0 + touch) / (1.0 + worth)
