"""The three searches obey the laws of the loop's contract."""

from skillframe.testing import SkillConformance


class TestSearch(SkillConformance):
    skill_type = "search"


class TestSpiral(SkillConformance):
    skill_type = "spiral"


class TestRandomWalk(SkillConformance):
    skill_type = "random_walk"
