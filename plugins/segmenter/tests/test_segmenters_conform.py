"""The three segmenters and the policy obey the laws that every plug-in is held to."""

from skillframe_testkit.suites import SegmenterConformance, SkillConformance


class TestWrenchHmm(SegmenterConformance):
    segmenter = "wrench_hmm"


class TestPoseHmm(SegmenterConformance):
    segmenter = "pose_hmm"


class TestZvc(SegmenterConformance):
    segmenter = "zvc"


class TestPolicy(SkillConformance):
    skill_type = "policy"
