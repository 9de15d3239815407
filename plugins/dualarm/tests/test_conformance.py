from skillframe_testkit.suites import CoordinatorConformance


class TestDualArm(CoordinatorConformance):
    skill_type = "dual_arm"
