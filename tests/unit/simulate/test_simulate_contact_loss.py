"""Wheels leave the rail behind a nose where the force of the P2 oscillation exceeds their static load."""

from turnout.report.simulation_figures import contact_loss


def test_contact_is_lost_behind_a_deep_nose_at_speed_alone():
    assert contact_loss(1.0e-3, 80.0 / 3.6) == 0.0  # 0.15 m/s
    assert contact_loss(0.3e-3, 160.0 / 3.6) == 0.0  # 0.09 m/s
    assert contact_loss(1.0e-3, 160.0 / 3.6) > 0.3  # 0.30 m/s
