from skillframe.testing import CoordinatorConformance


class TestDualArm(CoordinatorConformance):
    skill_type = "dual_arm"
