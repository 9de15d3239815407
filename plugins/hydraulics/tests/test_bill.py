"""The energy bill: sums over samples, whenever they are asked for."""

import numpy as np
import pytest
from skillframe_hydraulics.columns import EnergyBill

DT, SUPPLY = 1e-3, np.array([[150e5, 190e5], [200e5, 210e5]])


class Bank:
    """Two trials of two cylinders whose flows and forces are chance."""

    def __init__(self, outputs=("force", "flow_a", "flow_b")):
        self.outputs, self._rng = list(outputs), np.random.default_rng(0)
        self.y = np.zeros((4, len(outputs)))

    def turn(self):
        self.y[:] = self._rng.normal(size=self.y.shape)
        return self._rng.normal(size=(2, 2))


@pytest.mark.parametrize("asked", [1, 7, 1000])
def test_the_bill_is_the_sum_over_samples_however_seldom_it_is_asked_for(asked):
    """Inflow at p_S times dt, and the trapezoidal rule of F v, the first sample counted as if it had lasted."""
    bank = Bank()
    bill = EnergyBill(bank, SUPPLY, DT)
    supply, pistons, last = np.zeros(2), np.zeros(2), None
    for tick in range(305):
        velocity = bank.turn()
        inflow = np.maximum(bank.y[:, 1:], 0.0).sum(axis=1).reshape(2, 2)
        supply += DT * (SUPPLY * inflow).sum(axis=1)
        power = (bank.y[:, 0].reshape(2, 2) * velocity).sum(axis=1)
        pistons += 0.5 * DT * (power + (power if last is None else last))
        last = power
        bill.step(velocity)
        if tick % asked == 0:
            np.testing.assert_allclose(bill.supply, supply, rtol=1e-12)  # rounding of 300 sums
            np.testing.assert_allclose(bill.pistons, pistons, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(bill.supply, supply, rtol=1e-12)
    np.testing.assert_allclose(bill.pistons, pistons, rtol=1e-12, atol=1e-15)


def test_a_new_bill_owes_nothing_and_one_without_flows_does_not_know_the_supply():
    bank = Bank()
    bill = EnergyBill(bank, SUPPLY, DT)
    bill.step(bank.turn())
    bill.start()
    assert bill.supply.tolist() == bill.pistons.tolist() == [0.0, 0.0]
    assert np.isnan(EnergyBill(Bank(("force",)), SUPPLY, DT).supply).all()
